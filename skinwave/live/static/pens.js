// Pens of pictures: the same calls draw on a canvas or write SVG. Lengths in pixels.

const FONT = "system-ui, sans-serif";

/** Draws on a canvas what SvgPen writes. */
export class CanvasPen {
  constructor(context) { this.context = context; }
  line(points, { colour, width = 1, dash = [], opacity = 1 }) {
    const { context } = this;
    Object.assign(context, { strokeStyle: colour, lineWidth: width, globalAlpha: opacity });
    Object.assign(context, { lineCap: "round", lineJoin: "round" });
    context.setLineDash(dash);
    context.beginPath();
    points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.globalAlpha = 1;
  }
  circle([x, y], radius, { colour, width = 1, fill = null }) {
    const { context } = this;
    context.setLineDash([]);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    Object.assign(context, { strokeStyle: colour, lineWidth: width, fillStyle: fill });
    if (fill) context.fill();
    context.stroke();
  }
  box(x, y, width, height, colour) {
    this.context.fillStyle = colour;
    this.context.fillRect(x, y, width, height);
  }
  text([x, y], words, { colour, size = 11, anchor = "start", bold = false }) {
    Object.assign(this.context, { fillStyle: colour, font: `${bold ? "600 " : ""}${size}px ${FONT}`,
      textAlign: { start: "left", middle: "center", end: "right" }[anchor] });
    this.context.fillText(words, x, y);
  }
  image(drawn, x, y, width, height, opacity = 1) {
    this.context.globalAlpha = opacity;
    this.context.drawImage(drawn, x, y, width, height);
    this.context.globalAlpha = 1;
  }
  within(x, y, width, height, draw) {
    this.context.save();
    this.context.beginPath();
    this.context.rect(x, y, width, height);
    this.context.clip();
    draw();
    this.context.restore();
  }
  width(words, size) {
    this.context.font = `${size}px ${FONT}`;
    return this.context.measureText(words).width;
  }
}

let clips = 0;
const ENTITIES = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => ENTITIES[c]);

/** Writes as SVG what CanvasPen draws. */
export class SvgPen {
  constructor() { this.parts = []; }
  line(points, { colour, width = 1, dash = [], opacity = 1 }) {
    const d = points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(2)},${y.toFixed(2)}`).join("");
    const dashes = dash.length ? ` stroke-dasharray="${dash}"` : "";
    this.parts.push(`<path d="${d}" fill="none" stroke="${colour}" stroke-width="${width}"`
      + ` stroke-linecap="round" stroke-linejoin="round" opacity="${opacity}"${dashes}/>`);
  }
  circle([x, y], radius, { colour, width = 1, fill = null }) {
    this.parts.push(`<circle cx="${x.toFixed(2)}" cy="${y.toFixed(2)}" r="${radius}" fill="${fill || "none"}"`
      + ` stroke="${colour}" stroke-width="${width}"/>`);
  }
  box(x, y, width, height, colour) {
    this.parts.push(`<rect x="${x}" y="${y}" width="${width}" height="${height}" fill="${colour}"/>`);
  }
  text([x, y], words, { colour, size = 11, anchor = "start", bold = false }) {
    this.parts.push(`<text x="${x}" y="${y}" fill="${colour}" font-size="${size}" text-anchor="${anchor}"`
      + `${bold ? ' font-weight="600"' : ""}>${escaped(words)}</text>`);
  }
  image(drawn, x, y, width, height, opacity = 1) {
    this.parts.push(`<image href="${drawn.toDataURL()}" x="${x}" y="${y}" width="${width}" height="${height}"`
      + ` preserveAspectRatio="none" opacity="${opacity}"/>`);
  }
  within(x, y, width, height, draw) {
    const id = `within-${clips++}`;
    const box = `<rect x="${x}" y="${y}" width="${width}" height="${height}"/>`;
    this.parts.push(`<clipPath id="${id}">${box}</clipPath><g clip-path="url(#${id})">`);
    draw();
    this.parts.push("</g>");
  }
  width(words, size) { return 0.55 * size * words.length; }
}
