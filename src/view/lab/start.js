// The start of the page, its texts, and names that the scripts shared with other pages expect.

const beginning = JSON.parse(document.getElementById("start").textContent);
const texts = JSON.parse(document.getElementById("texts").textContent);

// Built-in models: the number of links of each at `first`, and the `made` ones by number of links.
const models = JSON.parse(document.getElementById("models").textContent);
const chainAlone = {};

/// The system in the words of a link: a built-in model, or the one that the page was written for.
function movedBy(words) {
  const told = new URLSearchParams(words);
  const family = models[told.get("model")];
  if (family) return family.made[told.get("n")] ?? family.made[family.first];
  return told.get("model") === "chain" ? chainAlone : beginning;
}

const named = new URLSearchParams(location.hash.slice(1)).get("model");
const moved = movedBy(location.hash.slice(1));
const model = moved.model ?? null; // null: a chain
const linkChoices = Object.keys(models[named]?.made ?? {}).map(Number);

const at = (id) => document.getElementById(id);

// Plots and colours of other pages expect runs; here there is one motion, which grows.
const scene = { timeUnit: "s", lengthUnit: "m" };
const runs = [null];

let language = "en";

/// The text of a key in the language that is chosen; {names} are replaced.
function text(key, names = {}) {
  const found = texts[language][key] ?? texts.en[key] ?? key;
  return found.replace(/\{(\w+)\}/g, (_, name) => names[name] ?? "");
}

/// Writes all texts of the page again.
function writeTexts(chosen) {
  language = texts[chosen] ? chosen : "en";
  document.documentElement.lang = language;
  for (const each of document.querySelectorAll("[data-text]")) if (each.dataset.text) each.textContent = text(each.dataset.text);
  for (const each of document.querySelectorAll("[data-label]")) each.setAttribute("aria-label", text(each.dataset.label));
  for (const each of document.querySelectorAll("[data-label][type=button]")) each.title = text(each.dataset.label);
}

/// Lets a screen reader say words.
function say(words) {
  at("said").textContent = words;
}
