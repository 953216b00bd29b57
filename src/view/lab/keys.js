// Buttons, keys and pointers, and the calls of the laboratory that they lead to.

class Keys {
  constructor(lab) {
    this.lab = lab;
    this.#listen();
  }

  #listen() {
    const on = (id, event, act) => at(id).addEventListener(event, act);
    on("play", "click", () => this.lab.play());
    on("again", "click", () => this.lab.again());
    on("back", "click", () => this.lab.step(-1));
    on("forward", "click", () => this.lab.step(1));
    on("now", "click", () => this.lab.seek(this.lab.history.end));
    on("scrub", "input", () => {
      this.lab.play(false);
      this.lab.seek(Number(at("scrub").value));
    });
    on("speed", "change", () => {
      this.lab.state.speed = Number(at("speed").value);
      this.lab.looks.writeLink();
    });
    on("level", "change", () => {
      this.lab.state.level = at("level").value;
      this.lab.looks.change();
    });
    on("language", "change", () => {
      this.lab.state.lang = at("language").value;
      this.lab.looks.change();
    });
    on("theme", "click", () => this.lab.looks.switchTheme());
    on("link", "click", () => this.lab.looks.copyLink());
    on("open-help", "click", () => this.#help());
    on("reset-view", "click", () => {
      this.lab.stage.reset();
      this.lab.changed();
    });
    for (const name of ["velocities", "angles", "ruler", "trace"]) on(`show-${name}`, "click", () => this.lab.looks.toggle(name));
    on("stopwatch", "click", () => this.lab.watch.press());
    watchHand(this.lab);
    addEventListener("hashchange", () => this.lab.looks.follow());
    addEventListener("keydown", (event) => this.#key(event));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.lab.looks.change());
    new ResizeObserver(() => {
      this.lab.stage.resize();
      this.lab.changed();
    }).observe(at("stage"));
    new ResizeObserver(() => this.lab.changed()).observe(at("panels"));
    addEventListener("scroll", () => this.lab.changed(), { passive: true });
    at("panels").addEventListener("scroll", () => this.lab.changed(), { passive: true });
  }

  #help() {
    const keys = [["Space", "play"], ["← →", "key.step"], ["Home", "again"], ["+ −", "key.speed"], ["B", "key.bob"], ["← → ↑ ↓", "key.move"], ["Enter", "key.drop"], ["V", "tool.velocities"], ["A", "tool.angles"], ["U", "tool.ruler"], ["R", "view.reset"], ["T", "theme"]];
    at("keys").replaceChildren(...keys.map(([key, words]) => element("div", {}, element("dt", {}, element("kbd", { textContent: key })), element("dd", { textContent: text(words) }))));
    at("help").showModal();
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || at("help").open) return;
    const { target } = event;
    if (target.matches?.("input, select, textarea")) return;
    if (target.matches?.("button") && (event.key === " " || event.key === "Enter")) return;
    const act = this.lab.hand.isHolding ? this.#handKey(event.key) : this.#plainKey(event.key);
    if (!act) return;
    event.preventDefault();
    act();
  }

  #handKey(key) {
    const by = 0.05 * this.lab.stage.reach;
    const [right, up] = this.lab.stage.axes;
    const move = (a, b) => () => this.lab.hand.moveTo(this.lab.hand.wanted.map((x, axis) => x + by * (a * right[axis] + b * up[axis])));
    return { ArrowLeft: move(-1, 0), ArrowRight: move(1, 0), ArrowUp: move(0, 1), ArrowDown: move(0, -1), Enter: () => this.lab.hand.drop(), Escape: () => this.lab.hand.drop(), b: () => this.lab.hand.takeNext(), B: () => this.lab.hand.takeNext() }[key] ?? this.#plainKey(key);
  }

  #plainKey(key) {
    const faster = (by) => () => {
      const next = speedChoices[speedChoices.indexOf(this.lab.state.speed) + by];
      if (!next) return;
      this.lab.state.speed = next;
      at("speed").value = next;
      this.lab.looks.writeLink();
    };
    return {
      " ": () => this.lab.play(), ArrowLeft: () => this.lab.step(-1), ArrowRight: () => this.lab.step(1), Home: () => this.lab.again(), End: () => this.lab.seek(this.lab.history.end),
      "+": faster(1), "-": faster(-1), "−": faster(-1), b: () => this.lab.hand.takeNext(), B: () => this.lab.hand.takeNext(), v: () => this.lab.looks.toggle("velocities"), a: () => this.lab.looks.toggle("angles"), u: () => this.lab.looks.toggle("ruler"),
      r: () => {
        this.lab.stage.reset();
        this.lab.changed();
      },
      t: () => this.lab.looks.switchTheme(), "?": () => this.#help(),
    }[key];
  }
}
