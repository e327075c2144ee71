// The page: its tabs, and the hand of the summary. The address's fragment names a tab's panel, or something in it.

const tabs = [...document.querySelectorAll("[role=tab]")];
const panels = tabs.map((tab) => document.getElementById(tab.getAttribute("aria-controls")));

function showTab() {
  const target = document.getElementById(location.hash.slice(1));
  const shown = Math.max(panels.findIndex((panel) => panel.contains(target)), 0);
  tabs.forEach((tab, at) => {
    tab.setAttribute("aria-selected", String(at === shown));
    tab.tabIndex = at === shown ? 0 : -1;
    panels[at].hidden = at !== shown;
  });
  // The browser looked for the target while it was hidden.
  if (panels.includes(target)) scrollTo(0, 0);
  else target?.scrollIntoView();
}

document.querySelector("[role=tablist]").addEventListener("keydown", (event) => {
  const at = tabs.indexOf(document.activeElement), last = tabs.length - 1;
  const next = { ArrowLeft: at - 1, ArrowRight: (at + 1) % tabs.length, Home: 0, End: last }[event.key];
  if (next === undefined) return;
  event.preventDefault();
  tabs.at(next).focus();
  history.pushState(null, "", tabs.at(next).hash); // following the link would take the focus away
  showTab();
});
addEventListener("hashchange", showTab);
addEventListener("beforeprint", () => {
  for (const long of document.querySelectorAll("details")) long.open = true;
});
showTab();

const { hand } = JSON.parse(document.getElementById("page-data").textContent), svg = document.getElementById("kept-hand");
const flat = hand.switches.length + hand.taxels.length > 0, joints = flat ? [] : hand.joints;
const drawn = drawHand(svg, { ...hand, joints });
const bits = [...hand.switches.map(({ bit }) => bit), ...hand.taxels.flatMap(({ levels = [] }) => levels.map(([, bit]) => bit))];
drawn.setClosed(bits.filter((bit) => bit !== undefined).map(() => true));
drawn.setPose(joints.map(({ low, high }) => (low + high) / 2));
svg.setAttribute("aria-label", svg.dataset.name);
