"use strict";
// Ties the page together: scenes, selection, theme, keys.

/** Selects a configuration everywhere, or none if it was selected. */
function select(name) {
  const chosen = state.configuration === name ? null : name;
  change({ configuration: chosen });
  const picture = pictureOf(currentScene(), chosen);
  if (picture && view.b) load(picture, view.b);
}

function showScene(index, focus = false) {
  if (!study.scenes[index]) return;
  change({ scene: index });
  const tab = byId(`tab-${index}`);
  if (focus) tab.focus();
  tab.scrollIntoView({ block: "nearest", inline: "nearest" });
}

/** Tabs, tables and lists of the current scene. */
function drawScene() {
  const scene = currentScene();
  for (const tab of document.querySelectorAll("[data-scene-tab]")) {
    const on = Number(tab.dataset.sceneTab) === state.scene;
    tab.setAttribute("aria-selected", String(on));
    tab.tabIndex = on ? 0 : -1;
  }
  for (const article of document.querySelectorAll("article.scene")) {
    article.hidden = Number(article.dataset.scene) !== state.scene;
  }
  for (const label of document.querySelectorAll("[data-scene-name]")) label.textContent = scene?.name ?? "";
  const targets = scene?.targets ?? [];
  if (!targets.includes(state.target)) state.target = targets[0] ?? null;
  byId("target").replaceChildren(...targets.map((t) => html("option", { value: t }, t)));
  byId("target").value = state.target;
  viewScene(scene);
}

onChange((what) => {
  if ("scene" in what) drawScene();
  if (Object.keys(what).some((key) => key !== "configuration")) drawFigures();
  highlight();
});

byId("metric").append(...[...metricLabels].map(([metric, label]) => html("option", { value: metric }, label)));
byId("metric").value = state.metric;
byId("metric").addEventListener("change", (event) => change({ metric: event.target.value }));
byId("target").addEventListener("change", (event) => change({ target: event.target.value }));
byId("abscissa").addEventListener("change", (event) => change({ abscissa: event.target.value }));

byId("scene-tabs").addEventListener("click", (event) => {
  const tab = event.target.closest("[data-scene-tab]");
  if (tab) showScene(Number(tab.dataset.sceneTab));
});
byId("scene-tabs").addEventListener("keydown", (event) => {
  const to = { ArrowLeft: state.scene - 1, ArrowRight: state.scene + 1, Home: 0, End: study.scenes.length - 1 }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  showScene(Math.min(Math.max(to, 0), study.scenes.length - 1), true);
});

document.addEventListener("click", (event) => {
  const button = event.target.closest("[data-pick]");
  if (!button) return;
  const row = button.closest("[data-row-scene]");
  if (row && Number(row.dataset.rowScene) !== state.scene) {
    state.configuration = null;
    showScene(Number(row.dataset.rowScene));
  }
  if (!button.classList.contains("goto")) {
    select(button.dataset.pick);
    return;
  }
  if (state.configuration !== button.dataset.pick) select(button.dataset.pick);
  if (view.a) {
    goTo(Number(button.dataset.x), Number(button.dataset.y));
    byId("pictures").scrollIntoView();
    canvas.focus({ preventScroll: true });
  }
});

for (const place of document.querySelectorAll("[data-swatch]")) place.replaceChildren(swatch(place.dataset.swatch));

/** Light or dark: as the system has it until it is chosen here. */
const systemDark = window.matchMedia("(prefers-color-scheme: dark)");
const isDark = () => ({ dark: true, light: false })[document.documentElement.dataset.theme] ?? systemDark.matches;

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  const next = isDark() ? "Light" : "Dark";
  byId("theme-toggle").textContent = next;
  byId("theme-toggle").setAttribute("aria-label", `Switch to ${next.toLowerCase()} colours`);
}

// Browsers may refuse to keep anything for a file: then it is not kept.
function kept(action) {
  try { return action(); } catch { return null; }
}

function toggleTheme() {
  const theme = isDark() ? "light" : "dark";
  setTheme(theme);
  kept(() => localStorage.setItem("etendue-theme", theme));
}

systemDark.addEventListener("change", () => setTheme(document.documentElement.dataset.theme));
byId("theme-toggle").addEventListener("click", toggleTheme);

function toggleHelp() {
  const help = byId("help");
  help.hidden = !help.hidden;
  byId("help-toggle").setAttribute("aria-expanded", String(!help.hidden));
  if (!help.hidden) help.scrollIntoView({ block: "nearest" });
}

byId("help-toggle").addEventListener("click", toggleHelp);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input, textarea")) return;
  const action = {
    "?": toggleHelp,
    d: toggleTheme,
    n: () => showScene(Math.min(state.scene + 1, study.scenes.length - 1)),
    p: () => showScene(Math.max(state.scene - 1, 0)),
    Escape: () => { byId("help").hidden || toggleHelp(); hideTip(); },
  }[event.key];
  if (!action) return;
  event.preventDefault();
  action();
});

let drawnWidth = 0;
new ResizeObserver(() => {
  if (document.body.clientWidth === drawnWidth) return;
  drawnWidth = document.body.clientWidth;
  drawFigures();
}).observe(document.body);

document.body.classList.add("scripted");
setTheme(kept(() => localStorage.getItem("etendue-theme")) ?? "auto");
change({ scene: 0 });
document.body.dataset.ready = "true";
