// Mouse and touch on a stage: dragging things, and turning, moving and zooming the view.

/// `take(event, x, y)` returns whether a pointer takes something there: then drag(x, y) and drop() follow. Other pointers change
/// the view, and changed() is called. pass(event, x, y) is called for pointers that press nothing.
function watchGestures(stage, { changed, take = () => false, drag, drop, pass = () => {} }) {
  const { canvas } = stage;
  const fingers = new Map();
  let holder = null;

  const place = (event) => [event.offsetX, event.offsetY];
  const pair = () => {
    const [[ax, ay], [bx, by]] = fingers.values();
    return { spread: Math.hypot(ax - bx, ay - by), middle: [(ax + bx) / 2, (ay + by) / 2] };
  };
  const pinch = (before) => {
    const { spread, middle } = pair();
    if (before.spread > 0 && spread > 0) stage.zoom(spread / before.spread, ...middle);
    stage.move(middle[0] - before.middle[0], middle[1] - before.middle[1]);
  };

  canvas.addEventListener("pointerdown", (event) => {
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch {
      // a pointer that is gone
    }
    fingers.set(event.pointerId, place(event));
    const isPlain = event.button <= 0 && !event.shiftKey && fingers.size === 1;
    if (holder === null && isPlain && take(event, ...place(event))) holder = event.pointerId;
  });
  canvas.addEventListener("pointermove", (event) => {
    const now = place(event);
    const last = fingers.get(event.pointerId);
    if (!last) {
      pass(event, ...now);
      return;
    }
    const before = fingers.size > 1 ? pair() : null;
    fingers.set(event.pointerId, now);
    const turns = stage.space === 3 && !event.shiftKey && !(event.buttons & 6);
    if (holder === event.pointerId) drag(...now);
    else if (before) pinch(before);
    else stage[turns ? "turn" : "move"](now[0] - last[0], now[1] - last[1]);
    changed();
  });
  for (const ended of ["pointerup", "pointercancel", "lostpointercapture"]) {
    canvas.addEventListener(ended, (event) => {
      fingers.delete(event.pointerId);
      if (holder !== event.pointerId) return;
      holder = null;
      drop();
      changed();
    });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    stage.zoom(Math.exp(-clamp(pixels, -200, 200) * 0.0016), event.offsetX, event.offsetY);
    changed();
  }, { passive: false });
}

/// Makes a canvas as fine as the screen, at most two pixels to one of CSS. Returns whether its size changed.
function fitCanvas(canvas, width, height) {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  const [w, h] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
  if (canvas.width === w && canvas.height === h) return false;
  canvas.width = w;
  canvas.height = h;
  return true;
}
