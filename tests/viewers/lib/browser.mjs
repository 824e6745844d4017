// Headless Chromium on pages of this folder, served to itself: viewers come from node_modules, scenes from a folder.
import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import puppeteer from "puppeteer-core";
import { here } from "./program.mjs";

const chromium = process.env.CHROMIUM ?? "/usr/bin/chromium";
const types = { ".html": "text/html", ".mjs": "text/javascript", ".js": "text/javascript", ".wasm": "application/wasm" };
// WebGL 2 by software: the same pictures on any machine.
const flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"];

function serve(scenes) {
  const server = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
    if (path === "/favicon.ico") return response.writeHead(204).end();
    const file = path.startsWith("/scenes/") ? join(scenes, path.slice(8)) : join(here, path);
    if (!existsSync(file) || !statSync(file).isFile()) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": types[extname(file)] ?? "application/octet-stream" });
    createReadStream(file).pipe(response);
  });
  return new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(server)));
}

/** Opens the browser; `draw(viewer, job)` has a page of its own draw, and returns its picture and what it complained about. */
export async function openBrowser(scenes) {
  const server = await serve(scenes);
  const browser = await puppeteer.launch({ executablePath: chromium, headless: true, args: flags });
  const address = `http://127.0.0.1:${server.address().port}/pages/index.html`;

  async function ask(module, task, job) {
    const page = await browser.newPage();
    const complaints = [];
    page.on("console", (message) => {
      if (["warn", "error"].includes(message.type())) complaints.push(message.text());
    });
    page.on("pageerror", (error) => complaints.push(String(error)));
    page.on("response", (r) => r.status() >= 400 && complaints.push(`${r.status()} ${r.url()}`));
    try {
      await page.goto(address);
      const answer = await page.evaluate((...a) => window.ask(...a), module, task, job);
      return { answer, complaints };
    } catch (error) {
      throw new Error(`${module}: ${error.message}\n${complaints.join("\n")}`);
    } finally {
      await page.close();
    }
  }

  async function draw(viewer, job) {
    const { answer, complaints } = await ask(viewer, "draw", job);
    return { ...picture(answer), said: answer.said, complaints };
  }

  const close = async () => {
    await browser.close();
    server.close();
  };
  const version = await browser.version();
  return { ask, draw, close, version };
}

/** RGB of what a page read back: rows from below, RGBA, bytes or floats. */
function picture({ width, height, base64, float }) {
  const bytes = Buffer.from(base64, "base64");
  const values = new Float32Array(width * height * 3);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const from = 4 * ((height - 1 - y) * width + x);
      for (let c = 0; c < 3; c++) {
        const value = float ? bytes.readFloatLE(4 * (from + c)) : bytes[from + c] / 255;
        values[3 * (y * width + x) + c] = value;
      }
    }
  }
  return { width, height, values };
}
