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

export { InputError };
