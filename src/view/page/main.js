// Puts the parts together.

/// Describes the runs of the page, and how many of their rows it has.
function describePage() {
  const rows = (run) => (run.stride > 1 ? `every ${ordinal(run.stride)} of ${run.seen} rows` : `${run.rows} ${run.rows === 1 ? "row" : "rows"}`);
  const [first, second] = runs;
  const parts = [scene.subject, ...(second ? [`${runs.length} runs`] : []), rows(first)];
  if (second && rows(second) !== rows(first)) parts.push(`the other runs: ${rows(second)}`);
  at("subtitle").textContent = [...parts, `pendula ${scene.version}`].join(" · ");
}

/// The legend: the colour of each run.
function drawLegend() {
  if (runs.length < 2) return;
  const mark = (colour) => Object.assign(element("i"), { style: `background: ${colour}` });
  if (runs.length <= palette.curves.length) {
    at("legend").replaceChildren(...runs.map((run, k) => element("span", {}, mark(rgba(palette.run(k))), run.label)));
    return;
  }
  const ramp = mark(`linear-gradient(to right, ${[0, 0.25, 0.5, 0.75, 1].map((p) => rgba(palette.ramp(p))).join(",")})`);
  ramp.className = "ramp";
  at("legend").replaceChildren(element("span", {}, `${runs[0].label} `, ramp, runs.at(-1).label));
}

/// Redraws stage and plots when their sizes change.
function watchSizes(stage, host, panels) {
  new ResizeObserver(() => stage.resize()).observe(host);
  for (const each of panels) {
    new ResizeObserver(() => each.plot.axes.isStale && each.redraw()).observe(each.box.plot);
  }
}

function start() {
  const host = at("stage");
  const player = new Player();
  const stage = scene.dimension ? new Theatre(host, new Motion()) : new Lanes(host);
  stage.canvas.setAttribute("role", "img");
  stage.canvas.setAttribute("aria-label", stage.description);
  document.documentElement.dataset.stage = { 0: "lanes", 2: "plane", 3: "space" }[scene.dimension];
  if (!scene.dimension) document.querySelector(".corner").hidden = true;
  const panels = makePanels(player);
  document.documentElement.dataset.panels = panels.length;
  let isDue = true;
  const due = () => (isDue = true);
  const marks = new Marks(player);
  const controls = new Controls(player, stage, marks, () => {
    palette.read();
    drawLegend();
    marks.redraw();
    for (const each of panels) each.redraw();
    due();
  });
  stage.onChange = due;
  player.listen(due);
  describePage();
  drawLegend();
  stage.resize();
  for (const each of panels) each.refresh();
  watchSizes(stage, host, panels);
  const frame = (now) => {
    if (player.advance(now) || isDue) {
      isDue = false;
      stage.draw(player.time, controls.trace);
      for (const each of panels) each.drawCursor();
    }
    requestAnimationFrame(frame);
  };
  stage.draw(player.time, controls.trace);
  performance.mark("pendula first frame");
  requestAnimationFrame(frame);
  // The motion starts by itself, unless the user has asked for reduced motion.
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.play(true);
}

start();
