"use strict";
(() => {
  const points = JSON.parse(document.getElementById("report-data").textContent);
  const radios = [...document.querySelectorAll("#points input")];
  const rows = radios.map((radio) => radio.closest("tr"));
  const markers = [...document.querySelectorAll(".point")];

  // Highlight a point's row and its markers, one in each chart.
  function mark(number, name, wanted) {
    for (const element of [...rows, ...markers]) {
      if (element.dataset.point === number) element.classList.toggle(name, wanted);
    }
  }

  function showOnHand(switches) {
    const order = new Map(switches.map((number, place) => [number, place + 1]));
    document.querySelectorAll("#picked-hand .dot").forEach((dot, number) => {
      dot.classList.toggle("kept", order.has(number));
      dot.querySelector("text").textContent = order.get(number) ?? "";
    });
  }

  function pick(number) {
    for (const radio of radios) {
      radio.checked = radio.value === number;
      mark(radio.value, "picked", radio.checked);
    }
    const point = points[number];
    const summary = document.getElementById("picked-hand-summary");
    if (summary) summary.textContent = point.said;
    showOnHand(point.on_hand);
    document.getElementById("picked-said").textContent = point.said;
    document.querySelectorAll("#picked-facts dd").forEach((cell, place) => (cell.textContent = point.facts[place][1]));
    const names = point.switches.map((name) => Object.assign(document.createElement("li"), { textContent: name }));
    document.getElementById("picked-switches").replaceChildren(...names);
    document.getElementById("picked-command").textContent = point.command;
  }

  for (const radio of radios) radio.addEventListener("change", () => pick(radio.value));
  for (const marker of markers) marker.addEventListener("click", () => pick(marker.dataset.point));
  for (const element of [...rows, ...markers]) {
    element.addEventListener("pointerenter", () => mark(element.dataset.point, "near", true));
    element.addEventListener("pointerleave", () => mark(element.dataset.point, "near", false));
  }
})();
