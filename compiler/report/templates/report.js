"use strict";
(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const root = document.documentElement;
  const config = {
    displaylogo: false,
    responsive: true,
    modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
  };
  const plain = { ...config, modeBarButtons: [["toImage"]] };
  const onPaper = 680; // pixels: as wide as a sheet of A4 between its margins
  const radios = [...document.querySelectorAll("#points input")];
  const first = radios.find((radio) => radio.checked);
  let picked = first ? first.value : null;

  // Figures name colours of the style sheet; Plotly wants them as they are at this moment.
  function coloured(value, style) {
    if (Array.isArray(value)) return value.map((each) => coloured(each, style));
    if (value && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([name, each]) => [name, coloured(each, style)]));
    }
    const name = typeof value === "string" && /^var\((--[a-z-]+)\)$/.exec(value);
    return name ? style.getPropertyValue(name[1]).trim() : value;
  }

  function draw(id) {
    const figure = coloured(data.charts[id], getComputedStyle(root));
    const { ring, places } = figure.layout.meta || {};
    if (ring !== undefined && places[picked]) {
      figure.data[ring].x = [places[picked][0]];
      figure.data[ring].y = [places[picked][1]];
    }
    if (root.classList.contains("on-paper")) figure.layout.width = onPaper;
    Plotly.react(id, figure.data, figure.layout, ring === undefined ? plain : config).then(hideDrawings);
  }

  // A screen reader has the caption, the buttons and the table; loose numbers of axes tell it nothing.
  function hideDrawings() {
    for (const drawing of document.querySelectorAll(".plot svg, #js-plotly-tester")) {
      drawing.setAttribute("aria-hidden", "true");
    }
  }

  function drawAll() {
    Object.keys(data.charts).forEach(draw);
  }

  function showOnHand(switches) {
    const order = new Map(switches.map((number, place) => [String(number), String(place + 1)]));
    for (const dot of document.querySelectorAll("#picked-hand .dot")) {
      const place = order.get(dot.dataset.switch);
      dot.classList.toggle("kept", place !== undefined);
      dot.querySelector("text").textContent = place || "";
    }
  }

  function showPicked() {
    const point = data.points[picked];
    const summary = document.getElementById("picked-hand-summary");
    if (summary) summary.textContent = point.said;
    showOnHand(point.on_hand);
    document.getElementById("picked-said").textContent = point.said;
    document.querySelectorAll("#picked-facts dd").forEach((cell, place) => (cell.textContent = point.facts[place]));
    const names = point.switches.map((name) => Object.assign(document.createElement("li"), { textContent: name }));
    document.getElementById("picked-switches").replaceChildren(...names);
    document.getElementById("picked-command").textContent = point.command;
  }

  function pick(number) {
    picked = String(number);
    for (const radio of radios) {
      radio.checked = radio.value === picked;
      radio.closest("tr").classList.toggle("chosen", radio.checked);
    }
    showPicked();
    Object.keys(data.charts).filter((id) => data.charts[id].layout.meta).forEach(draw);
  }

  for (const radio of radios) radio.addEventListener("change", () => pick(radio.value));
  drawAll();
  for (const id of Object.keys(data.charts)) {
    document.getElementById(id).on("plotly_click", (event) => {
      const number = event.points[0].customdata;
      if (number !== undefined && data.points[number]) pick(number);
    });
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  addEventListener("beforeprint", () => {
    root.classList.add("on-paper");
    drawAll();
  });
  addEventListener("afterprint", () => {
    root.classList.remove("on-paper");
    drawAll();
  });
})();
