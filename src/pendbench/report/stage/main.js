// The page of a stage alone: it begins to play.
function start() {
  const connect = chosenTheme(document.documentElement);
  const started = startStage(JSON.parse(byId("data").textContent), document);
  connect(started.redraw);
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) started.clock.play();
  return started;
}

window.pendbench = start();
