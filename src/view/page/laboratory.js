// Opens the laboratory, a page contained in this one, at the state that is shown.

/// The state of the first run at a time, as the words of a laboratory's link.
function laboratoryLink(time) {
  const [run] = runs;
  const row = run.rowAt(time);
  const chain = { theta: ["th", "w"], phi: ["ph", "wp"] };
  const words = new Map([["t", [run.t[row]]]]);
  for (const [name, , , ...columns] of scene.coordinates) {
    const keys = scene.lengths.length ? chain[name.split("_")[0]] : ["q", "v"];
    keys.forEach((key, k) => {
      if (!words.has(key)) words.set(key, []);
      words.get(key).push(run.column(columns[k])[row]);
    });
  }
  return [scene.laboratory, ...[...words].map(([key, numbers]) => `${key}=${numbers.join(",")}`)].join("&");
}

/// Opens the laboratory in a window of its own, paused at the state of a time.
function openLaboratory(time) {
  const page = JSON.parse(document.getElementById("laboratory").textContent);
  const address = URL.createObjectURL(new Blob([page], { type: "text/html" }));
  window.open(`${address}#${laboratoryLink(time)}`);
}
