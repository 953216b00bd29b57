// Buttons, keys and dialogs, and the calls of player and stage that they lead to.

const at = (id) => document.getElementById(id);

/// Text that a screen reader says aloud.
function say(text) {
  at("said").textContent = text;
}

class Controls {
  constructor(player, stage, marks, onTheme) {
    this.player = player;
    this.stage = stage;
    this.marks = marks;
    this.onTheme = onTheme;
    this.#fillSpeeds();
    this.#wireBar();
    this.#wireDialogs();
    this.#wireTools();
    document.addEventListener("keydown", (event) => this.#key(event));
    player.listen((what) => (what === "time" ? this.showTime() : this.showState()));
    this.showState();
    this.showTime();
  }

  /// The trace that is wanted, as a part of the run's time.
  get trace() {
    return Number(at("trace").value);
  }

  showTime() {
    const { player } = this;
    const digits = Math.min(Math.max(3 - Math.floor(Math.log10(player.duration || 1)), 0), 12);
    const text = `${steady(player.time, digits)} ${scene.timeUnit}`;
    at("clock").textContent = text;
    at("time").textContent = text;
    const scrub = at("scrub");
    scrub.value = player.time;
    const whole = player.playing ? Math.floor(player.time) : text;
    if (this.said !== whole) scrub.setAttribute("aria-valuetext", text);
    this.said = whole;
  }

  showState() {
    const { player } = this;
    at("play").classList.toggle("playing", player.playing);
    at("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
    at("loop").setAttribute("aria-pressed", player.loop);
    at("speed").value = player.speed;
    this.showTime();
  }

  #fillSpeeds() {
    const name = (speed) => (speed < 1 ? `1/${1 / speed}` : String(speed));
    at("speed").append(...speeds.map((speed) => option(speed, `${name(speed)} ×`)));
  }

  #wireBar() {
    const { player } = this;
    const scrub = at("scrub");
    scrub.min = player.start;
    scrub.max = player.end;
    at("whole").textContent = `of ${readable(player.end, 6)} ${scene.timeUnit}`;
    scrub.addEventListener("input", () => player.seek(Number(scrub.value)));
    at("play").addEventListener("click", () => this.#togglePlay());
    at("back").addEventListener("click", () => player.step(-1));
    at("forward").addEventListener("click", () => player.step(1));
    at("loop").addEventListener("click", () => player.set("loop", !player.loop));
    at("speed").addEventListener("change", () => player.set("speed", Number(at("speed").value)));
    at("trace").value = runs.length > 1 ? "0.05" : player.duration > 30 ? "0.05" : "0.15";
    at("trace").addEventListener("change", () => this.stage.onChange());
    at("reset").addEventListener("click", () => this.stage.reset());
  }

  #togglePlay() {
    this.player.play();
    say(this.player.playing ? "Playing" : `Paused at ${at("clock").textContent}`);
  }

  #wireTools() {
    at("theme").addEventListener("click", () => this.#switchTheme());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.onTheme());
  }

  #switchTheme() {
    document.documentElement.dataset.theme = palette.isDark ? "light" : "dark";
    this.onTheme();
  }

  #wireDialogs() {
    at("open-help").addEventListener("click", () => at("help").showModal());
    at("go-on").hidden = !scene.laboratory;
    at("go-on").addEventListener("click", () => openLaboratory(this.player.time));
    at("open-data").addEventListener("click", () => at("data").showModal());
    at("scenario").textContent = scene.scenario || "(none)";
    at("run").append(...runs.map((run, k) => option(k, run.label || `run ${k + 1}`)));
    at("which-run").hidden = runs.length < 2;
    at("run").addEventListener("change", () => this.#showHonesty());
    at("copy-csv").addEventListener("click", (event) => copy(this.#run().csv(), event.currentTarget));
    at("save-csv").addEventListener("click", () => save(this.#run().csv(), csvName()));
    at("copy-scenario").addEventListener("click", (event) => copy(scene.scenario, event.currentTarget));
    at("about").textContent = `Made by pendula ${scene.version}. Between rows, motion is cubic in time; rods keep their length.`;
    this.#showHonesty();
  }

  #run() {
    return runs[Number(at("run").value) || 0];
  }

  #showHonesty() {
    const run = this.#run();
    const kind = run.exact
      ? "All columns with 17 digits, at times that suit pictures."
      : "Coordinates and rates as 32-bit numbers, about 7 digits, at times that suit pictures.";
    const rest = "The trajectory file has the rows that the scenario asks for.";
    at("honesty").textContent = `${run.rows} rows. ${kind} ${run.thinning} ${rest}`;
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const { target } = event;
    if (target.closest("select, pre, input:not([type=range]):not([type=checkbox])")) return;
    if (event.key === " " && target.closest("button, input[type=checkbox]")) return;
    const action = this.#actions()[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action(event.shiftKey);
  }

  #actions() {
    const { player, stage, marks } = this;
    const steer = (x, y) => (shift) => stage.steer(x, y, shift);
    return {
      " ": () => this.#togglePlay(),
      ArrowLeft: (shift) => player.step(shift ? -10 : -1),
      ArrowRight: (shift) => player.step(shift ? 10 : 1),
      Home: () => player.seek(player.start),
      End: () => player.seek(player.end),
      n: () => marks.go(1),
      p: () => marks.go(-1),
      "+": () => player.faster(1),
      "=": () => player.faster(1),
      "-": () => player.faster(-1),
      l: () => player.set("loop", !player.loop),
      r: () => stage.reset(),
      t: () => this.#switchTheme(),
      a: steer(-1, 0),
      d: steer(1, 0),
      w: steer(0, 1),
      s: steer(0, -1),
      q: () => stage.zoom(1 / 1.15),
      e: () => stage.zoom(1.15),
      "?": () => at("help").showModal(),
    };
  }
}

/// The name of the CSV file: that of the scenario, without its folder.
function csvName() {
  const stem = scene.title.replace(/^.*[\\/]/, "").replace(/\.toml$/, "");
  return `${stem || "run"}.csv`;
}

/// Copies to the clipboard; where the browser does not allow that for a file of the disk, by the older call.
async function copy(text, button) {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = element("textarea", { value: text, readOnly: true });
    button.after(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  button.textContent = "Copied";
  say("Copied");
  setTimeout(() => (button.textContent = before), 1500);
}

function save(text, name) {
  const address = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
