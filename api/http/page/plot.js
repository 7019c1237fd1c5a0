"use strict";
// Two traces over the last 20 seconds on one canvas; each with an axis of its own colour and a range that only grows.
const SPAN_S = 20;

class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.rows = [];
    this.top = { force: 2, depth: 2 };
  }

  add(timeS, force, depth) {
    this.rows.push([timeS, force, depth]);
    while (this.rows.length && this.rows[0][0] < timeS - SPAN_S) this.rows.shift();
  }

  draw() {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    pen.scale(ratio, ratio);
    this.box = { left: 44, right: width - 44, top: 8, bottom: height - 20 };
    this.grow("force", 1);
    this.grow("depth", 2);
    this.grid(pen, this.colour(style, "--line"), this.colour(style, "--quiet"));
    this.trace(pen, 2, this.top.depth, this.colour(style, "--depth"));
    this.trace(pen, 1, this.top.force, this.colour(style, "--force"));
    this.labels(pen, this.colour(style, "--force"), this.colour(style, "--depth"));
  }

  colour(style, name) {
    const probe = document.createElement("span");
    probe.style.color = `var(${name})`;
    document.body.append(probe);
    const value = getComputedStyle(probe).color;
    probe.remove();
    return value;
  }

  grow(name, column) {
    const largest = Math.max(0, ...this.rows.map((row) => row[column] ?? 0));
    while (this.top[name] < largest) this.top[name] *= 2;
  }

  x(timeS) {
    const last = this.rows.length ? this.rows[this.rows.length - 1][0] : 0;
    return this.box.right - (last - timeS) / SPAN_S * (this.box.right - this.box.left);
  }

  y(value, top) {
    const share = (value + 0.05 * top) / (1.1 * top);
    return this.box.bottom - Math.max(0, Math.min(1, share)) * (this.box.bottom - this.box.top);
  }

  grid(pen, line, quiet) {
    pen.strokeStyle = line;
    pen.fillStyle = quiet;
    pen.textAlign = "center";
    const last = this.rows.length ? this.rows[this.rows.length - 1][0] : 0;
    for (let back = 0; back <= SPAN_S; back += 5) {
      const x = this.x(last - back);
      pen.beginPath(); pen.moveTo(x, this.box.top); pen.lineTo(x, this.box.bottom); pen.stroke();
      pen.fillText(back ? `-${back} s` : "now", x, this.box.bottom + 14);
    }
  }

  trace(pen, column, top, colour) {
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    pen.beginPath();
    let down = false;
    for (const row of this.rows) {
      if (row[column] === null) { down = false; continue; }
      const x = this.x(row[0]), y = this.y(row[column], top);
      if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
      down = true;
    }
    pen.stroke();
    pen.lineWidth = 1;
  }

  labels(pen, force, depth) {
    for (const share of [0, 0.5, 1]) {
      pen.textAlign = "right"; pen.fillStyle = force;
      pen.fillText((share * this.top.force).toFixed(1), this.box.left - 6, this.y(share * this.top.force, this.top.force) + 4);
      pen.textAlign = "left"; pen.fillStyle = depth;
      pen.fillText((share * this.top.depth).toFixed(1), this.box.right + 6, this.y(share * this.top.depth, this.top.depth) + 4);
    }
  }
}
