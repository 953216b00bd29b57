// The worker that computes.

class Computer {
  #waiting = new Map();
  #count = 0;

  constructor() {
    const source = document.getElementById("worker").textContent;
    const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.worker = new Worker(address);
    this.worker.onmessage = ({ data }) => {
      const { take, refuse } = this.#waiting.get(data.number);
      this.#waiting.delete(data.number);
      if (data.error !== undefined) refuse(Object.assign(new Error(data.error), { isOpen: data.isOpen }));
      else take(data);
    };
    this.worker.onerror = (event) => {
      for (const { refuse } of this.#waiting.values()) refuse(new Error(event.message || "worker"));
      this.#waiting.clear();
    };
  }

  /// Sends an order; resolves to its answer.
  ask(order, what = {}, transfer = []) {
    const number = ++this.#count;
    return new Promise((take, refuse) => {
      this.#waiting.set(number, { take, refuse });
      this.worker.postMessage({ order, number, ...what }, transfer);
    });
  }

  async start() {
    const module = bytesOfBase64(document.getElementById("module").textContent);
    await this.ask("start", { module }, [module.buffer]);
  }
}
