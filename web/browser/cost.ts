// What the page costs, printed: npm run browser-cost. Nothing is judged: machines differ.
import { existsSync } from "node:fs";
import { gzipSync } from "node:zlib";
import type { Browser } from "playwright-core";
import { launch } from "./page";
import { configuration, Server } from "./server";

const SECONDS = 20;
const MOVING = ["press", "two_touches", "stroke", "press", "two_touches", "stroke"];

async function sizeOf(url: string): Promise<number> {
  const page = await (await fetch(url)).text();
  const scripts = new Set([...page.matchAll(/[\w-]+\.js/g)].map((match) => match[0]).concat("arm_scene.js"));
  let bytes = 0;
  for (const name of scripts) {
    const script = await fetch(new URL(name, url), { headers: { "accept-encoding": "identity" } });
    bytes += gzipSync(Buffer.from(await script.arrayBuffer()), { level: 9 }).length;
  }
  return bytes;
}

type Watched = typeof globalThis & { firstPictureMs?: number };

// In the page itself: what asks from outside comes late while the page is busy.
function watchForPicture(): void {
  const look = () => {
    const canvas = document.querySelector<HTMLCanvasElement>(".scene canvas");
    const isDrawn = Number(canvas?.dataset.frames ?? 0) > 0 && document.querySelector(".status.s3") !== null;
    if (isDrawn) (globalThis as Watched).firstPictureMs = performance.now();
    else setTimeout(look, 5);
  };
  look();
}

/** From when the browser began to load the page to the first picture of measured frames, ms. */
async function firstPicture(browser: Browser, url: string): Promise<number> {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  await page.addInitScript(watchForPicture);
  await page.goto(url, { waitUntil: "commit" });
  const seen = await page.waitForFunction(() => (globalThis as Watched).firstPictureMs);
  const took = Number(await seen.jsonValue());
  await page.close();
  return took;
}

interface Load {
  script: number;
  task: number;
  frames: number;
}

async function load(browser: Browser, url: string, hidden: boolean): Promise<Load> {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  await page.goto(url);
  await page.waitForSelector(".status.s3");
  if (hidden) {
    await page.evaluate(() => {
      Object.defineProperty(document, "hidden", { value: true });
      document.dispatchEvent(new Event("visibilitychange"));
    });
    await page.waitForTimeout(6000);
  } else {
    await page.waitForTimeout(2000);
  }
  const cdp = await page.context().newCDPSession(page);
  await cdp.send("Performance.enable");
  const read = async () => {
    const { metrics } = await cdp.send("Performance.getMetrics");
    const value = (name: string) => metrics.find((each) => each.name === name)!.value;
    const frames = await page.evaluate(() =>
      Number(document.querySelector<HTMLCanvasElement>(".scene canvas")?.dataset.frames ?? 0),
    );
    return { script: value("ScriptDuration"), task: value("TaskDuration"), frames };
  };
  const before = await read();
  await page.waitForTimeout(SECONDS * 1000);
  const after = await read();
  await page.close();
  return {
    script: (after.script - before.script) / SECONDS,
    task: (after.task - before.task) / SECONDS,
    frames: (after.frames - before.frames) / SECONDS,
  };
}

async function measure(links: number): Promise<void> {
  const server = new Server();
  const scenes = Object.fromEntries(
    Array.from({ length: links }, (_, i) => [`link${i + 1}`, MOVING[i % MOVING.length]]),
  );
  const config = server.write("arm.yaml", configuration("cost", scenes));
  await server.start("--config", config);
  const browser = await launch();
  const percent = (share: number) => `${(100 * share).toFixed(0)} %`;
  await firstPicture(browser, server.url);
  const first: number[] = [];
  for (let i = 0; i < 8; ++i) first.push(await firstPicture(browser, server.url));
  first.sort((a, b) => a - b);
  const seen = await load(browser, server.url, false);
  const hidden = await load(browser, server.url, true);
  console.log(
    `${links} links: first picture ${first.map((ms) => ms.toFixed(0)).join(", ")} ms; main thread: ` +
      `${percent(seen.task)} of a core, scripts ${percent(seen.script)}, ${seen.frames.toFixed(1)} pictures/s; ` +
      `hidden: ${percent(hidden.task)}, ${hidden.frames.toFixed(1)} pictures/s`,
  );
  if (links === 6) console.log(`JavaScript, gzip: ${((await sizeOf(server.url)) / 1000).toFixed(0)} kB`);
  await browser.close();
  await server.close();
}

if (!existsSync("/usr/bin/chromium") && !process.env.CHROMIUM)
  throw new Error("apt-get install chromium, or set CHROMIUM");
for (const links of [6, 16]) await measure(links);
