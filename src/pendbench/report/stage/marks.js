// The marks of points, by the letters that matplotlib has for them, with a radius of 1.
const POLYGONS = {
  s: [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
  D: [[0, -1.25], [1.25, 0], [0, 1.25], [-1.25, 0]],
  "^": [[0, -1.15], [1.1, 0.9], [-1.1, 0.9]],
  v: [[0, 1.15], [1.1, -0.9], [-1.1, -0.9]],
  ">": [[1.15, 0], [-0.9, 1.1], [-0.9, -1.1]],
  P: [[-0.4, -1.1], [0.4, -1.1], [0.4, -0.4], [1.1, -0.4], [1.1, 0.4], [0.4, 0.4], [0.4, 1.1], [-0.4, 1.1], [-0.4, 0.4], [-1.1, 0.4], [-1.1, -0.4], [-0.4, -0.4]],
  X: [[0, -0.5], [0.7, -1.2], [1.2, -0.7], [0.5, 0], [1.2, 0.7], [0.7, 1.2], [0, 0.5], [-0.7, 1.2], [-1.2, 0.7], [-0.5, 0], [-1.2, -0.7], [-0.7, -1.2]],
  h: regular(6, 1.15, 1),
  p: regular(5, 1.15, 1),
  "*": regular(10, 1.4, 0.55),
};

// A polygon whose corners are by turns so far from its middle.
function regular(count, one, other) {
  const inner = count > 6 ? other : one;
  return Array.from({ length: count }, (_, i) => {
    const [angle, radius] = [(2 * Math.PI * i) / count - Math.PI / 2, i % 2 ? inner : one];
    return [radius * Math.cos(angle), radius * Math.sin(angle)];
  });
}

function markAt(pen, letter, x, y, radius) {
  pen.beginPath();
  const corners = POLYGONS[letter];
  if (!corners) return pen.arc(x, y, radius, 0, 2 * Math.PI);
  for (const [right, down] of corners) pen.lineTo(x + radius * right, y + radius * down);
  return pen.closePath();
}

// A point as a line has it: filled, or open where that means something; that of a hollow line has a rim.
function drawMark(pen, colours, line, x, y, radius = Math.min(Math.max(0.65 * line.size, 3.2), 9)) {
  const hollow = line.mark && line.mark.hollow;
  const colour = colours.tone(line.colour);
  markAt(pen, line.marker, x, y, radius);
  pen.fillStyle = colour;
  pen.strokeStyle = hollow ? colours.ink : line.filled ? colours.card : colour;
  pen.lineWidth = hollow || !line.filled ? 1.4 : 0.8;
  if (line.filled) pen.fill();
  pen.stroke();
}
