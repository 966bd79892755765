// What every page here has: its elements, and a theme that follows the system and a button.
function byId(id) {
  return document.getElementById(id);
}

function element(name, className, text) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

function chosenTheme(root) {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const set = () => { root.dataset.theme = dark.matches ? "dark" : "light"; };
  set();
  return (redraw) => {
    dark.addEventListener("change", () => { set(); redraw(); });
    byId("theme").addEventListener("click", () => {
      root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
      redraw();
    });
  };
}
