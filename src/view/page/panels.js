// The plots beside the stage.

function checkbox(text, checked, onChange) {
  const box = element("input", { type: "checkbox", checked });
  box.addEventListener("change", onChange);
  return { node: element("label", {}, box, text), get on() { return box.checked; }, box };
}

/// Names each curve of one run; for several runs the legend of the page has the names.
function nameRuns(keys, curves, words) {
  nameCurves(keys, runs.length > 1 ? [] : curves.map((curve) => [rgba(curve.colour()), curve.name]), words);
}

/// Curves of one number a run, over time, on a log scale.
class LogPanel {
  constructor(title, player, arrayOf, sentence) {
    this.box = panel(title);
    this.plot = new TimePlot(this.box.plot, title, player);
    const held = runs.map((run, k) => ({ run, k, numbers: arrayOf(run) })).filter((each) => each.numbers);
    const largest = held.reduce((most, { numbers }) => numbers.reduce((m, x) => (x > m ? x : m), most), 0);
    this.plot.axes.describe(`${title} over time. ${sentence(readable(largest, 3))}`);
    this.box.heading.title = sentence(readable(largest, 3));
    const alpha = held.length > 8 ? 0.35 : 1;
    this.curves = held.map(({ run, k, numbers }) => ({
      run, numbers, alpha, colour: () => (runs.length > 1 ? palette.run(k) : palette.rgb.accent),
    }));
    this.box.keys.append(sentence(readable(largest, 3)));
  }

  refresh() {
    this.plot.show(this.curves, "log");
  }
  redraw() {
    this.plot.redraw();
  }
  drawCursor() {
    this.plot.drawCursor();
  }
}

/// Coordinates over time: several of one run, or one of several runs.
class CoordinatesPanel {
  constructor(player) {
    const refresh = () => this.refresh();
    const title = groups.every((group) => group.isAngle) ? "Angles" : "Coordinates";
    this.picker = runs.length > 1 ? new MemberPicker(title, refresh) : new RangePicker(title, refresh);
    this.wrapped = checkbox("within ±π", groups.length > 0 && groups[0].isAngle && this.#turns(), refresh);
    this.box = panel(title, [...this.picker.nodes, this.wrapped.node]);
    this.plot = new TimePlot(this.box.plot, `${title} over time`, player);
  }

  refresh() {
    const { group } = this.picker;
    const members = runs.length > 1 ? [this.picker.member] : this.picker.members;
    this.wrapped.node.hidden = !group.isAngle;
    const curves = members.flatMap((member, m) => runs.map((run, k) => ({
      run,
      numbers: run.column(member.column),
      scale: member.scale,
      colour: () => (runs.length > 1 ? palette.run(k) : palette.curves[m]),
      alpha: runs.length > 8 ? 0.4 : 1,
      name: runs.length > 1 ? run.label : symbol(member.name),
    })));
    this.plot.show(curves, group.isAngle && this.wrapped.on ? "wrapped" : "linear");
    this.plot.axes.describe(`${members.map((m) => m.name).join(", ")} over time, in ${group.unit}`);
    const names = runs.length > 1 ? members.map((m) => symbol(m.name)).join(", ") : "";
    this.words = `${names} in ${group.unit}`.trim();
    this.#name();
  }

  redraw() {
    this.plot.redraw();
    this.#name();
  }
  drawCursor() {
    this.plot.drawCursor();
  }

  #name() {
    nameRuns(this.box.keys, this.plot.curves, this.words);
  }

  // Whether any angle makes a full turn.
  #turns() {
    const { members } = groups[0];
    return members.some(({ column }) => runs[0].column(column).some((angle) => Math.abs(angle) > 2 * Math.PI));
  }
}

/// Inputs of one unit over time, for one run after the other.
class InputsPanel {
  constructor(player, unit, inputs) {
    this.box = panel("Inputs");
    this.plot = new TimePlot(this.box.plot, "Inputs over time", player);
    const several = runs.length > 1;
    this.curves = inputs.flatMap(([name, , column], m) => runs.map((run, k) => ({
      run, numbers: run.column(column), name: symbol(name),
      colour: () => (several ? palette.run(k) : palette.curves[m % palette.curves.length]), alpha: runs.length > 8 ? 0.4 : 1,
    })));
    const names = inputs.map(([name]) => symbol(name)).join(", ");
    this.words = `${several ? names : ""} in ${unitText(unit)}`.trim();
    this.plot.axes.describe(`${inputs.map(([name]) => name).join(", ")} over time, in ${unit}`);
  }

  refresh() {
    this.plot.show(this.curves, "linear");
    nameRuns(this.box.keys, this.curves, this.words);
  }
  redraw() {
    this.refresh();
  }
  drawCursor() {
    this.plot.drawCursor();
  }
}

/// The phase portrait of one coordinate.
class PhasePanel {
  constructor(player, isWrapped) {
    this.isWrapped = isWrapped;
    this.picker = new MemberPicker("Phase portrait", () => this.refresh());
    this.box = panel("Phase portrait", this.picker.nodes, "square");
    this.plot = new PhasePlot(this.box.plot, "Phase portrait", player);
  }

  refresh() {
    const { group, member } = this.picker;
    this.plot.show(member, group.isAngle && this.isWrapped());
    this.plot.axes.describe(`Phase portrait: rate of ${member.name} against ${member.name}`);
    const [name, { unit }] = [symbol(member.name), group];
    this.box.keys.textContent = `Rate of ${name} in ${[unit, scene.timeUnit].join("/")} over ${name} in ${unit}`;
  }
  redraw() {
    this.plot.redraw();
  }
  drawCursor() {
    this.plot.drawCursor();
  }
}

/// All panels that the runs have numbers for.
function makePanels(player) {
  const made = [];
  if (runs.length > 1) {
    made.push(new LogPanel("Distance from the first run", player, (run) => run.separations,
      (largest) => `At most ${largest} ${scene.dimension ? scene.lengthUnit : ""}`));
  }
  if (runs.some((run) => run.energyError?.some(Number.isFinite))) {
    const title = scene.loaded ? "Change of energy" : "Energy error";
    made.push(new LogPanel(title, player, (run) => run.energyError, (largest) => `|H − H₀|, relative: at most ${largest}`));
  }
  if (runs.some((run) => run.stepSizes)) {
    const least = Math.min(...runs.map((run) => run.stepSizes?.reduce((m, x) => (x < m ? x : m), Infinity) ?? Infinity));
    made.push(new LogPanel("Step size", player, (run) => run.stepSizes,
      (largest) => `From ${readable(least, 3)} to ${largest} ${scene.timeUnit}`));
  }
  for (const unit of new Set(scene.inputs.map(([, each]) => each))) {
    const inputs = scene.inputs.filter(([, each, column]) => each === unit && runs.some((run) => run.column(column).some((x) => x !== 0)));
    if (inputs.length > 0) made.push(new InputsPanel(player, unit, inputs));
  }
  if (groups.length > 0) {
    const angles = new CoordinatesPanel(player);
    const phase = new PhasePanel(player, () => angles.wrapped.on);
    angles.wrapped.box.addEventListener("change", () => phase.refresh());
    made.push(angles, phase);
  }
  return made;
}
