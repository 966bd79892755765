// What the pointer points at, in words beside it.
function showReadout(event, lines) {
  const box = byId("readout");
  box.hidden = !lines.length;
  if (!lines.length) return;
  box.textContent = lines.join("\n");
  const { width, height } = box.getBoundingClientRect();
  const left = event.clientX + 16 + width > window.innerWidth ? event.clientX - 16 - width : event.clientX + 16;
  box.style.left = `${Math.max(4, left)}px`;
  box.style.top = `${Math.min(Math.max(4, event.clientY - height / 2), window.innerHeight - height - 4)}px`;
}

function hideReadout() {
  byId("readout").hidden = true;
}
