// Numbers and small pieces of text, as people and as programs read them, and what finds them.

/// A number with 17 significant digits, from which the same double is read back: written as C's %.17g writes it.
function exactNumber(x) {
  if (!Number.isFinite(x)) return Number.isNaN(x) ? "nan" : x > 0 ? "inf" : "-inf";
  if (x === 0) return Object.is(x, -0) ? "-0" : "0";
  const [digits, exponent] = x.toExponential(16).split("e");
  const power = Number(exponent);
  if (power >= -4 && power < 17) return trimmed(x.toFixed(Math.min(16 - power, 100)));
  return `${trimmed(digits)}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
}

/// Without zeros at the end of a fraction.
function trimmed(text) {
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/// A number as people read it; a true minus sign.
function readable(x, digits = 4) {
  if (!Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  const text = size >= 1e5 || size < 1e-3 ? trimmedExponential(x, digits) : String(Number(x.toPrecision(digits)));
  return text.replaceAll("-", "−");
}

/// A number that changes while it is read: always with the same number of digits after the point. Rounding errors do not
/// change them, and zero has no sign.
function steady(x, digits = 2) {
  const text = Number(x.toFixed(digits + 6)).toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

function trimmedExponential(x, digits) {
  const [mantissa, exponent] = x.toExponential(digits - 1).split("e");
  return `${trimmed(mantissa)}e${Number(exponent)}`;
}

/// A power of ten, 10⁻⁷.
function powerOfTen(exponent) {
  const raised = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
  return `10${[...String(exponent)].map((c) => raised[c]).join("")}`;
}

/// 2nd, 4th, 32nd.
function ordinal(number) {
  const teens = number % 100 > 10 && number % 100 < 14;
  return `${number}${(!teens && { 1: "st", 2: "nd", 3: "rd" }[number % 10]) || "th"}`;
}

/// Digits as indices.
function lowered(digits) {
  return [...digits].map((c) => "₀₁₂₃₄₅₆₇₈₉"[c]).join("");
}

/// theta_12 as θ₁₂, torque_y_1 as τ₁ (y): the name of a coordinate or an input in plots.
function symbol(name) {
  const greek = { theta: "θ", phi: "φ", psi: "ψ", alpha: "α", beta: "β", gamma: "γ", torque: "τ" };
  const [stem, ...rest] = name.split("_");
  const index = rest.join("_");
  const [, axis, link] = /^(?:([xyz])_)?(\d+)$/.exec(index) ?? [];
  const below = link ? lowered(link) + (axis ? ` (${axis})` : "") : index && `_${index}`;
  return (greek[stem] ?? stem) + below;
}

/// sqrt(l_1/g) as √(l₁/g).
function unitText(unit) {
  return unit.replaceAll("sqrt", "√").replace(/_(\d+)/g, (_, digits) => lowered(digits));
}

/// Steps of 1, 2 or 5 powers of ten that divide a range in about `count`; finer ones where fewer than `least` lie in it.
function niceTicks(low, high, count, least = 0) {
  const rough = (high - low) / Math.max(count, 1);
  if (!(rough > 0) || !Number.isFinite(rough)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = [0.5, 1, 2, 5, 10];
  const coarse = steps.findIndex((m, k) => k > 0 && m * power >= rough * 0.999);
  const of = (step) => {
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; ++k) ticks.push(k * step);
    return ticks;
  };
  const ticks = of(steps[coarse] * power);
  return ticks.length < least ? of(steps[coarse - 1] * power) : ticks;
}

/// The index of the last of `count` entries, ordered by time, that is not later than a time; 0 if all are later.
function lastBy(time, count, timeOf) {
  let low = 0;
  let high = count - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (timeOf(middle) <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

/// An element with properties and children.
function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function bytesOfBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; ++k) bytes[k] = binary.charCodeAt(k);
  return bytes;
}
