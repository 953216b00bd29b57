// The looks of the page, by its state and its link.

class Looks {
  constructor(lab) {
    this.lab = lab;
  }

  /// Applies the looks in the state.
  read() {
    const { state } = this.lab;
    if (state.theme) document.documentElement.dataset.theme = state.theme;
    palette.read();
    document.documentElement.dataset.level = state.level;
    if (window.parent !== window) document.documentElement.dataset.embedded = "yes";
    at("title").dataset.text = models[named] ? `model.${named}` : beginning.title && moved === beginning ? "" : "title";
    writeTexts(state.lang || navigator.languages.map((each) => each.split("-")[0]).find((each) => texts[each]) || "en");
    document.title = `${at("title").textContent} – pendula`;
    at("language").replaceChildren(...Object.keys(texts).map((each) => element("option", { value: each, textContent: texts[each]["language.name"], selected: each === language })));
    at("level").value = state.level;
    at("speed").replaceChildren(...speedChoices.map((speed) => element("option", { value: speed, textContent: speed < 1 ? `1/${1 / speed}` : `${speed}×` })));
    if (!speedChoices.includes(state.speed)) at("speed").append(element("option", { value: state.speed, textContent: `${readable(state.speed)}×` }));
    at("speed").value = state.speed;
    for (const name of ["velocities", "angles", "ruler", "trace"]) at(`show-${name}`).setAttribute("aria-pressed", this.lab.show.has(name));
    document.documentElement.dataset.ruler = this.lab.show.has("ruler") ? "yes" : "";
  }

  writeLink() {
    clearTimeout(this.writing);
    this.writing = setTimeout(() => {
      this.lab.state.show = [...this.lab.show];
      try {
        window.history.replaceState(null, "", `#${linkOf(this.lab.state)}`);
      } catch {
        // some frames may not change their address
      }
    }, 250);
  }

  change() {
    this.read();
    writeTexts(language);
    this.lab.controls.refresh();
    for (const panel of this.lab.panels) panel.named = null;
    this.lab.play(this.lab.playing);
    this.writeLink();
    this.lab.changed();
  }

  toggle(name) {
    if (this.lab.show.has(name)) this.lab.show.delete(name);
    else this.lab.show.add(name);
    at(`show-${name}`).setAttribute("aria-pressed", this.lab.show.has(name));
    document.documentElement.dataset.ruler = this.lab.show.has("ruler") ? "yes" : "";
    this.writeLink();
    this.lab.changed();
  }

  switchTheme() {
    this.lab.state.theme = palette.isDark ? "light" : "dark";
    this.change();
  }

  async copyLink() {
    this.lab.state.show = [...this.lab.show];
    const words = `#${linkOf(this.lab.state)}`;
    window.history.replaceState(null, "", words);
    const address = location.href.split("#")[0] + words;
    const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
    say(text(copied ? "said.copied" : "said.address"));
    at("link").textContent = text(copied ? "said.copied" : "said.address");
    setTimeout(() => (at("link").textContent = text("link")), 1600);
  }

  /// Another system, with this number of links: reloads the page, with the same looks.
  go(name, links = 0) {
    const { level, lang, theme } = this.lab.state;
    const looks = Object.entries({ level, lang, theme }).filter(([, value]) => value).map(([key, value]) => `&${key}=${value}`);
    clearTimeout(this.writing);
    location.hash = `model=${name || ""}${links ? `&n=${links}` : ""}${looks.join("")}`;
  }

  // The user has typed another link.
  follow() {
    if (location.hash.slice(1) === linkOf(this.lab.state)) return;
    const words = location.hash.slice(1);
    if (new URLSearchParams(words).get("model") !== named || movedBy(words) !== moved) {
      location.reload(); // another system
      return;
    }
    this.lab.state = stateOf(location.hash.slice(1));
    this.lab.show = new Set(this.lab.state.show);
    this.read();
    this.lab.controls.make();
    this.lab.again();
    for (const panel of this.lab.panels) panel.begin?.();
  }
}
