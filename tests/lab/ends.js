// node ends.js MODULE FOLDER < cases.json > ends.json: where the module brings motions to, by the page's own engine.
const fs = require("fs");

const [file, folder] = process.argv.slice(2);
const cases = JSON.parse(fs.readFileSync(0, "utf8"));
const source = ["vectors.js", "algebra.js", "engine.js"].map((name) => fs.readFileSync(`${folder}/${name}`, "utf8")).join("\n");
const { Engine, startModule } = new Function(`${source}; return { Engine, startModule };`)();

WebAssembly.compile(fs.readFileSync(file)).then(async (module) => {
  const engine = new Engine(await startModule(module));
  const ends = cases.map(({ spec, start, duration, step, rows }) => {
    try {
      engine.begin(spec, { time: 0, ...start }, step ?? 0);
      const began = performance.now();
      const energies = [];
      const take = () => energies.push(engine.present().slice(1 + 2 * engine.size, 3 + 2 * engine.size).reduce((a, b) => a + b));
      take();
      if (rows) {
        while (engine.time < duration - 1e-9) {
          engine.next(null);
          if (Math.round(engine.time * 120) % rows === 0) take();
        }
      } else {
        engine.go(duration);
        take();
      }
      const { q, v } = engine.motion();
      return { q: [...q], v: [...v], energies, steps: engine.steps, seconds: (performance.now() - began) / 1000 };
    } catch (error) {
      return { error: error.message };
    }
  });
  process.stdout.write(JSON.stringify(ends));
});
