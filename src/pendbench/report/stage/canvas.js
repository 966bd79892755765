// What all drawings share: sharp canvases, the theme's colours, numbers for people.
const FONT = 'system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif';

function sharpen(canvas) {
  const box = canvas.getBoundingClientRect();
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(box.width * ratio));
  canvas.height = Math.max(1, Math.round(box.height * ratio));
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width: box.width, height: box.height, ratio };
}

// tone: a colour as it can be seen on this theme's cards.
function themeColours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  const card = read("card");
  const known = new Map();
  const tone = (colour) => {
    if (!known.has(colour)) known.set(colour, seenOn(colour, card));
    return known.get(colour);
  };
  return {
    card, ink: read("ink"), soft: read("soft"), rule: read("rule"),
    ghost: read("ghost"), ghostInk: read("ghost-ink"), beyond: read("beyond"), tone,
  };
}

const LEAST_CONTRAST = 2.2; // of what is drawn; all hues have it on white and on black, but not all of their shades

function channels(text) {
  if (text.startsWith("rgb")) return text.match(/\d+/g).slice(0, 3).map(Number);
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
}

function luminance(parts) {
  const [red, green, blue] = parts.map((part) => {
    const share = part / 255;
    return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

// The colour itself, or mixed with black or white until it stands out from the card.
function seenOn(colour, card) {
  const [parts, ground] = [channels(colour), luminance(channels(card))];
  const far = ground > 0.3 ? 0 : 255;
  for (let share = 0; share <= 1; share += 0.05) {
    const mixed = parts.map((part) => Math.round(part + share * (far - part)));
    const [high, low] = [luminance(mixed), ground].sort((a, b) => b - a);
    if ((high + 0.05) / (low + 0.05) >= LEAST_CONTRAST) return share ? `rgb(${mixed.join(", ")})` : colour;
  }
  return colour;
}

// A number for people, with so many digits where it is neither tiny nor huge.
function numberText(value, digits = 2) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e4) return String(Number(value.toPrecision(digits)));
  return value.toExponential(digits - 1).replace("e+", "e").replace(/\.0+e/, "e");
}

// Steps of 1, 2 or 5 that divide a range into about so many parts.
function roundStep(range, parts) {
  const rough = range / parts;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((part) => part * power >= rough * 0.999);
}
