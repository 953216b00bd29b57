// What does not fit on a page: window.misfits(mayScroll) -> sentences, none where all does. It watches from the start
// what is written on canvases, which have no boxes of text of their own.
(() => {
  const written = new Map(); // canvas -> boxes of text since it was last cleared
  const { clearRect, fillText } = CanvasRenderingContext2D.prototype;
  CanvasRenderingContext2D.prototype.clearRect = function (...area) {
    written.set(this.canvas, []);
    return clearRect.apply(this, area);
  };
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    if (!written.has(this.canvas)) written.set(this.canvas, []);
    const size = this.measureText(text);
    written.get(this.canvas).push({
      text,
      left: x - size.actualBoundingBoxLeft,
      right: x + size.actualBoundingBoxRight,
      top: y - size.actualBoundingBoxAscent,
      bottom: y + size.actualBoundingBoxDescent,
    });
    return fillText.call(this, text, x, y);
  };

  const isSeen = (element) => element.checkVisibility({ visibilityProperty: true }) && !element.closest(".unseen");
  const name = (element) => `${element.tagName.toLowerCase()}${element.id && `#${element.id}`} "${element.textContent.trim().slice(0, 30)}"`;
  const moved = (box, x, y) => ({ ...box, left: box.left + x, right: box.right + x, top: box.top + y, bottom: box.bottom + y });
  const isWithin = (box, outer) =>
    box.left >= outer.left - 1 && box.right <= outer.right + 1 && box.top >= outer.top - 1 && box.bottom <= outer.bottom + 1;
  const overlap = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;

  // The lines of an element's own text, or a control as a whole.
  function boxesOf(element) {
    if (element.matches("select, input")) return [element.getBoundingClientRect()];
    const range = document.createRange();
    return [...element.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE && node.data.trim()).flatMap((node) => {
      range.selectNodeContents(node);
      return [...range.getClientRects()];
    });
  }

  function labels() {
    const elements = [...document.body.querySelectorAll("*:not(option, script, style, pre, dialog *)")].filter(isSeen);
    const inElements = elements.flatMap((element) =>
      boxesOf(element).map(({ left, right, top, bottom }) => ({ text: name(element), element, left, right, top, bottom })),
    );
    const onCanvases = [...written].filter(([canvas]) => canvas.isConnected && isSeen(canvas)).flatMap(([canvas, boxes]) => {
      const { left, top } = canvas.getBoundingClientRect();
      return boxes.map((box) => ({ ...moved(box, left, top), element: canvas }));
    });
    return [...inElements, ...onCanvases];
  }

  window.misfits = (mayScroll) => {
    const found = [];
    const all = labels();
    const page = { left: 0, top: -scrollY, right: innerWidth, bottom: mayScroll ? document.documentElement.scrollHeight - scrollY : innerHeight };
    for (const label of all) {
      const { text, element } = label;
      const around = [element, element.closest(".panel, .theatre, .top, header, button")].filter((each) => each && !each.matches("label, span, output"));
      if (!around.every((each) => isWithin(label, each.getBoundingClientRect()))) found.push(`${text} leaves its box`);
      if (!isWithin(label, page)) found.push(`${text} leaves the page`);
    }
    all.forEach((a, k) => {
      for (const b of all.slice(k + 1)) if (overlap(a, b)) found.push(`${a.text} lies on ${b.text}`);
    });
    for (const element of [...document.querySelectorAll("body *")].filter(isSeen)) {
      const { overflowX, overflowY } = getComputedStyle(element);
      const scrolls = /auto|scroll/.test(overflowX + overflowY);
      const tooMuch = element.scrollWidth > element.clientWidth + 1 || element.scrollHeight > element.clientHeight + 1;
      if (scrolls && tooMuch) found.push(`${name(element)} scrolls`);
    }
    for (const plot of document.querySelectorAll(".plot")) {
      const { width, height } = plot.getBoundingClientRect();
      if (width < 180 || height < 99) found.push(`a plot of ${width} × ${height}`);
    }
    const { scrollWidth, scrollHeight, clientWidth, clientHeight } = document.documentElement;
    if (scrollWidth > clientWidth) found.push("the page is too wide");
    if (!mayScroll && scrollHeight > clientHeight) found.push("the page is too high");
    return [...new Set(found)];
  };
})();
