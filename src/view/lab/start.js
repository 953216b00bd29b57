// What the page begins with, its texts, and what the scripts of other pages expect to find.

const beginning = JSON.parse(document.getElementById("start").textContent);
const texts = JSON.parse(document.getElementById("texts").textContent);

// Built-in models: how many links each has at `first`, and what is `made` of it, by number of links.
const models = JSON.parse(document.getElementById("models").textContent);
const chainAlone = {};

/// What the words of a link say that moves: a built-in model, or what the page was written for.
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

// Plots and colours of other pages are of runs; here there is one motion, which grows.
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

/// Tells those who hear the page.
function say(words) {
  at("said").textContent = words;
}
