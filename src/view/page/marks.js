// Events of the runs: marks on the line of time, and buttons that lead from one to the next.

/// Half the width of the thumb of the line of time: the middle of the thumb stays so far from both ends.
const thumb = 8;

/// All events of one name, of all runs: {name, count, isThinned, marks}. `marks` has {name, time, up} of each, in the
/// order of time.
function occurrences(name) {
  const all = runs.flatMap((run) => run.events.filter((event) => event.name === name));
  const marks = all.flatMap((event) => event.times.map((time, k) => ({ name, time, up: event.up[k] })));
  return {
    name,
    count: all.reduce((sum, event) => sum + event.count, 0),
    isThinned: all.some((event) => event.stride > 1),
    marks: marks.sort((a, b) => a.time - b.time),
  };
}

class Marks {
  constructor(player) {
    this.player = player;
    const names = [...new Set(runs.flatMap((run) => run.events.map((event) => event.name)))];
    this.kinds = names.map(occurrences);
    this.host = at("marks");
    document.documentElement.dataset.events = names.length > 0 ? "some" : "none";
    if (names.length === 0) return;
    this.canvas = this.host.appendChild(element("canvas"));
    this.#fillKey();
    new ResizeObserver(() => this.redraw()).observe(this.host);
  }

  redraw() {
    if (!this.canvas) return;
    const { clientWidth: width, clientHeight: height } = this.host;
    fitCanvas(this.canvas, width, height);
    const pen = this.canvas.getContext("2d");
    const scale = this.canvas.width / Math.max(width, 1);
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineWidth = 1.5;
    this.kinds.forEach((kind, k) => {
      pen.strokeStyle = rgba(this.#colour(k), kind.marks.length > width / 4 ? 0.5 : 0.9);
      for (const { time, up } of kind.marks) this.#draw(pen, width, height, time, up);
    });
    this.#colourKey();
  }

  /// Goes to the next event after the time that is shown, or the last one before it; of any name, or of one. At the ends it
  /// starts over.
  go(way, kinds = this.kinds) {
    const { player } = this;
    const marks = kinds.flatMap((kind) => kind.marks).sort((a, b) => way * (a.time - b.time));
    if (marks.length === 0) return;
    const next = marks.find(({ time }) => way * (time - player.time) > 0) ?? marks[0];
    if (player.playing) player.play(false);
    player.seek(next.time);
    say(`${next.name}, ${next.up ? "up" : "down"}, at ${at("clock").textContent}`);
  }

  // A mark upwards from the middle, or downwards.
  #draw(pen, width, height, time, up) {
    const { player } = this;
    const x = thumb + ((time - player.start) / (player.duration || 1)) * (width - 2 * thumb);
    line(pen, x, height / 2, x, up ? 0 : height);
  }

  #fillKey() {
    this.buttons = this.kinds.map((kind) => {
      const shown = kind.isThinned ? `, of which ${kind.marks.length} are marked` : "";
      const title = `${kind.count} ${kind.count === 1 ? "time" : "times"}${shown}; to the next`;
      const button = element("button", { type: "button", title }, element("i"), `${kind.name} ${kind.count}`);
      button.addEventListener("click", () => this.go(1, [kind]));
      return button;
    });
    at("events").replaceChildren(...this.buttons);
  }

  #colourKey() {
    this.buttons.forEach((button, k) => (button.querySelector("i").style.background = rgba(this.#colour(k))));
  }

  #colour(k) {
    return palette.curves[k % palette.curves.length];
  }
}
