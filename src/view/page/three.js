// three.js, which the page has packed.

/// three.js, from the page; a loader of modules is what it takes us for, so that it leaves no global.
async function loadThree() {
  const packed = bytesOfBase64(document.getElementById("three").textContent);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const source = await new Response(stream).text();
  const door = `three ${Math.random()}`;
  window[door] = {};
  const script = element("script");
  script.textContent = `(function (exports, module, define) {${source}\n}).call({}, window["${door}"], {});`;
  document.head.append(script);
  const three = window[door];
  delete window[door];
  script.remove();
  return three;
}

const THREE = await loadThree().catch(() => null);
