// Mouse and touch on a canvas, as turning, moving and zooming.

/// Calls turn(dx, dy) and move(dx, dy) in pixels, zoom(factor, x, y) about a place of the canvas. Where turn is missing,
/// dragging moves.
function watchGestures(canvas, { turn, move, zoom }) {
  const fingers = new Map();
  let spread = null;
  let middle = null;

  const place = (event) => ({ x: event.offsetX, y: event.offsetY });
  const measure = () => {
    const [a, b] = [...fingers.values()];
    spread = b ? Math.hypot(a.x - b.x, a.y - b.y) : null;
    middle = b ? { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 } : null;
  };
  const pinch = () => {
    const before = { spread, middle };
    measure();
    if (before.spread > 0 && spread > 0) zoom(spread / before.spread, middle.x, middle.y);
    move(middle.x - before.middle.x, middle.y - before.middle.y);
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, place(event));
    measure();
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = place(event);
    fingers.set(event.pointerId, now);
    if (fingers.size > 1) {
      pinch();
      return;
    }
    const drag = turn && !event.shiftKey && !(event.buttons & 6) ? turn : move;
    drag(now.x - before.x, now.y - before.y);
  });
  for (const ended of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(ended, (event) => {
      fingers.delete(event.pointerId);
      measure();
    });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    zoom(Math.exp(-Math.min(Math.max(pixels, -200), 200) * 0.0016), event.offsetX, event.offsetY);
  }, { passive: false });
}

/// Takes the size of a stage's canvas: `width`, `height` in pixels of CSS, `fine` of the screen's to one of them.
function fitStage(stage) {
  const { clientWidth: width, clientHeight: height } = stage.canvas;
  fitCanvas(stage.canvas, width, height);
  stage.width = width;
  stage.height = height;
  stage.fine = stage.canvas.width / Math.max(width, 1);
}

/// Makes a canvas as fine as the screen, at most two pixels to one of CSS; says whether that changed anything.
function fitCanvas(canvas, width, height) {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  const [w, h] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
  if (canvas.width === w && canvas.height === h) return false;
  canvas.width = w;
  canvas.height = h;
  return true;
}
