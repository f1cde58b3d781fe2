"use strict";
// What the page does by itself: theme, keys, pause and zoom. Data come from the session, which `control` tells what is looked at.
window.live = (() => {
  const at = (id) => document.getElementById(id), all = (what) => document.querySelectorAll(what);
  const THEME = "hybridsep-live-theme", QUIET = 2, WAIT = 120; // s; ms, from a zoom to the request of its details
  const HERE = {sync: false}; // a property that the session need not know
  let plots = [], control, status, seen, range, view = null, paused = false, span = 10, timer = 0, waiting = false, told = Date.now();
  const found = {painted: 0, rows: 0, ready: false, running: false};

  const digits = (x) => x === 0 ? "0" : Math.abs(x) >= 999.5 ? Math.round(x).toLocaleString("en") : x.toPrecision(3);
  const put = (id, text, bad = false) => { const one = at(id); one.textContent = text; one.classList.toggle("bad", bad); };

  function tell(source) {
    status = source;
    told = Date.now();
    const now = JSON.parse(status.data.json[0]);
    const phase = {waiting: "waiting for samples", running: paused ? "paused" : "live", ended: "ended", failed: "stopped: " + now.message};
    const time = now.t === undefined ? "" : " · " + now.t.toFixed(1) + " s";
    at("phase").textContent = phase[now.phase] + (now.phase === "failed" ? "" : time);
    at("phase").className = now.phase;
    at("late").textContent = now.delay ? "Shown " + digits(1e3 * now.delay) + " ms late, as commands come when the drive gets them." : "";
    found.rows = now.rows;
    found.running = now.phase === "running";
    if (now.n_samples === undefined) return;
    for (const name of ["rms_pb", "rms_hold", "rms_h"]) put(name, now[name] === undefined ? "–" : digits(now.factor * now[name]) + " " + now.unit);
    for (const name of ["n_samples", "n_missing", "n_rejected", "n_repeated", "n_late", "n_malformed"])
      put(name, now[name].toLocaleString("en"), now[name] > 0 && name !== "n_samples");
    for (const name of ["step_p50", "step_p99", "step_max"]) put(name, digits(1e6 * now[name]) + " µs");
    put("model", now.active ? "hybrid" : "physics");
  }

  setInterval(() => {
    const quiet = (Date.now() - told) / 1000;
    if (found.running && quiet > QUIET) at("phase").textContent = "no samples for " + quiet.toFixed(0) + " s";
  }, 500);

  function frame() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; found.painted += 1; seen.data = {n: [found.painted]}; });
  }

  function ask(start = NaN, end = NaN) {
    control.data = {paused: [paused ? 1 : 0], span: [span], start: [start], end: [end]};
  }

  function pause(yes) {
    paused = yes;
    at("pause").setAttribute("aria-pressed", String(paused));
    at("pause").textContent = paused ? "Go on" : "Pause";
    tell(status);
    if (paused) {
      view = view ?? [range.start, range.end];
      return ask(...view);
    }
    view = null;
    for (const plot of plots) plot.y_range.reset(); // follows the lines again
    ask();
  }

  function zoomed(start = range.start, end = range.end) { // by a tool of a plot, or a key
    view = [start, end];
    range.setv({start, end});
    if (!paused) pause(true);
    clearTimeout(timer);
    timer = setTimeout(() => {
      if (!paused) return;
      range.setv({start: view[0], end: view[1]}); // once more: a frame may have been on its way
      ask(...view);
    }, WAIT);
  }

  function zoom(factor, shift = 0) {
    const [from, to] = paused ? view : [range.start, range.end], width = to - from;
    const left = (paused ? (from + to) / 2 - factor * width / 2 : to - factor * width) + shift * width;
    zoomed(left, left + factor * width);
  }

  function choose(seconds) {
    span = seconds;
    for (const one of all("[data-span]")) one.setAttribute("aria-pressed", String(Number(one.dataset.span) === span));
    pause(false);
  }

  function paint() {
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue("--" + name).trim();
    const dim = colour("dim"), line = colour("line");
    for (const plot of plots) {
      for (const axis of [...plot.below, ...plot.left])
        axis.setv({axis_label_text_color: dim, major_label_text_color: dim, axis_line_color: line, major_tick_line_color: line,
          minor_tick_line_color: null, axis_label_text_font_style: "normal", axis_label_text_font_size: "12px"}, HERE);
      for (const one of plot.center) if ("grid_line_color" in one.properties) one.setv({grid_line_color: line}, HERE);
      for (const {name, glyph} of plot.renderers)
        glyph.setv({["fill_color" in glyph.properties ? "fill_color" : "line_color"]: colour(name)}, HERE);
    }
  }

  function theme(dark, keep) {
    document.documentElement.classList.toggle("dark", dark);
    at("theme").textContent = dark ? "Light" : "Dark";
    if (keep) localStorage.setItem(THEME, dark ? "dark" : "light");
    paint();
  }

  function start(models) {
    const get = (name) => models instanceof Map ? models.get(name) : models[name];
    [plots, control, seen, range] = ["plots", "control", "seen", "range"].map(get);
    tell(get("status"));
    paint();
    found.ready = true;
    frame();
  }

  const isDark = () => document.documentElement.classList.contains("dark");
  const KEYS = {" ": () => pause(!paused), Escape: () => pause(false), "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2),
    "−": () => zoom(2), ArrowLeft: () => zoom(1, -0.25), ArrowRight: () => zoom(1, 0.25), d: () => theme(!isDark(), true), D: () => theme(!isDark(), true)};

  const wanted = matchMedia("(prefers-color-scheme: dark)");
  const stored = () => { try { return localStorage.getItem(THEME); } catch { return null; } };
  if (stored() ? stored() === "dark" : wanted.matches) document.documentElement.classList.add("dark");

  document.addEventListener("DOMContentLoaded", () => {
    theme(isDark(), false);
    wanted.addEventListener("change", () => { if (!stored()) theme(wanted.matches, false); });
    at("pause").onclick = () => pause(!paused);
    at("live").onclick = () => pause(false);
    at("in").onclick = () => zoom(0.5);
    at("out").onclick = () => zoom(2);
    at("theme").onclick = () => theme(!isDark(), true);
    for (const one of all("[data-span]")) one.onclick = () => choose(Number(one.dataset.span));
    for (const one of all("[data-line]")) one.onclick = () => {
      const show = one.getAttribute("aria-pressed") !== "true";
      one.setAttribute("aria-pressed", String(show));
      for (const plot of plots) for (const renderer of plot.renderers) if (renderer.name === one.dataset.line) renderer.visible = show;
    };
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !found.ready) return;
      const spans = [...all("[data-span]")];
      const act = KEYS[event.key] ?? (spans[event.key - 1] ? () => choose(Number(spans[event.key - 1].dataset.span)) : null);
      if (act === null || (event.key === " " && event.target.closest("button, summary"))) return;
      event.preventDefault();
      act();
    });
  });
  return {start, tell, frame, zoomed, found};
})();
