/* Errors for bad input: one sentence that says what was given, what is allowed, what to change.
 *
 * Mirrors sim/io/errors.py. All other errors are bugs. */

class InputError extends Error {
  /* about: "options" where an option of the plan is wrong; null: what is wrong follows from the question. */
  constructor(message, about = null) {
    super(message);
    this.name = new.target.name;
    this.about = about;
  }
}

/* Do some work, and write the name of a file before its refusals. naming */
function naming(where, work) {
  try {
    return work();
  } catch (refusal) {
    throw refusal instanceof InputError ? new InputError(`${where}: ${refusal.message}`) : refusal;
  }
}

export { InputError, naming };
