/* The planner in a worker, as seen from the page: questions with answers, and plans for the newest wish. */

class PlannerClient {
  /* `start` makes a new worker; `failed` is told of errors that no question has caused. */
  constructor(start, failed) {
    this.start = start;
    this.failed = failed;
    this.waiting = new Map();
    this.count = 0;
    this.wish = null;
    this.planning = null;
    this.begin();
  }

  begin() {
    this.worker = this.start();
    this.worker.onmessage = ({ data }) => this.receive(data);
    this.worker.onerror = (event) => {
      event.preventDefault();
      this.failed(`The planner has stopped: ${event.message || "the browser does not start workers here"}.`);
    };
  }

  /* Ask; the promise resolves with {answer} or {refusal}, and never rejects. */
  ask(what, content = {}, progress = null) {
    const id = ++this.count;
    return new Promise((resolve) => {
      this.waiting.set(id, { resolve, progress });
      this.worker.postMessage({ id, what, content });
    });
  }

  receive(data) {
    const question = this.waiting.get(data.id);
    if (data.progress) question?.progress?.(data.progress);
    else if (question) {
      this.waiting.delete(data.id);
      if (data.broken) this.failed(`The page has made an error: ${data.broken}`);
      question.resolve(data);
    }
  }

  /* Plan the newest wish. A plan that is being made is finished first; wishes between are dropped. */
  async plan(wish) {
    this.wish = wish;
    if (this.planning) return;
    while (this.wish) {
      const { content, began, progress, done } = this.wish;
      this.wish = null;
      began();
      this.planning = this.ask("plan", content, progress);
      const answer = await this.planning;
      this.planning = null;
      if (!answer.stopped) done(answer);
    }
  }

  /* Stop what is being made: the worker ends, and a new one begins. */
  stop() {
    this.worker.terminate();
    this.wish = null;
    const waiting = [...this.waiting.values()];
    this.waiting.clear();
    this.begin();
    for (const { resolve } of waiting) resolve({ stopped: true, refusal: "stopped" });
  }
}

export { PlannerClient };
