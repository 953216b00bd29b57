// Colours of the style sheet, in the light or the dark theme.

/// One colour of the style sheet as [red, green, blue], 0 to 255.
function styleColour(name) {
  const probe = document.body.appendChild(element("span", { hidden: true }));
  probe.style.color = `var(--${name})`;
  const parts = getComputedStyle(probe).color.match(/[\d.]+/g).slice(0, 3).map(Number);
  probe.remove();
  return parts;
}

/// All colours for drawings; read again when the theme changes.
class Palette {
  constructor() {
    this.read();
  }

  read() {
    const names = ["ground", "panel", "ink", "quiet", "line", "edge", "accent", "rod", "bob", "trace", "floor", "shade"];
    this.rgb = Object.fromEntries(names.map((name) => [name, styleColour(name)]));
    this.curves = [1, 2, 3, 4, 5, 6].map((k) => styleColour(`curve-${k}`));
    this.isDark = this.rgb.ground[0] < 128;
  }

  /// A colour of the sheet for a canvas.
  css(name, alpha = 1) {
    return rgba(this.rgb[name], alpha);
  }

  /// The colour of a run: one of the curves' if there are few runs, otherwise from a ramp from blue to yellow whose colours
  /// differ in brightness (after cividis).
  run(index) {
    if (runs.length === 1) return this.rgb.trace;
    if (runs.length <= this.curves.length) return this.curves[index];
    return this.ramp(index / (runs.length - 1));
  }

  ramp(place) {
    const stops = this.isDark
      ? [[64, 118, 200], [112, 150, 176], [166, 180, 140], [222, 202, 96], [255, 228, 84]]
      : [[0, 42, 110], [50, 84, 126], [98, 112, 118], [148, 128, 74], [178, 136, 0]];
    const at = Math.min(Math.max(place, 0), 1) * (stops.length - 1);
    const k = Math.min(Math.floor(at), stops.length - 2);
    return stops[k].map((from, c) => Math.round(from + (stops[k + 1][c] - from) * (at - k)));
  }
}

function rgba([red, green, blue], alpha = 1) {
  return `rgba(${red}, ${green}, ${blue}, ${alpha})`;
}

const palette = new Palette();
