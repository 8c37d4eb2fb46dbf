// Makes docs/dashboard/{poke,live,phone,twelve}.png: npm run pictures
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Page } from "playwright-core";
import { launch } from "./page";
import { configuration, Server } from "./server";

const REPOSITORY = fileURLToPath(new URL("../..", import.meta.url));
const WIDE = { width: 1600, height: 1000 };
const PHONE = { width: 390, height: 844 };

async function save(page: Page, name: string): Promise<void> {
  await page.screenshot({ path: join(REPOSITORY, "docs/dashboard", `${name}.png`) });
}

async function drawn(page: Page): Promise<void> {
  const canvas = page.locator(".scene canvas");
  const before = Number(await canvas.getAttribute("data-frames"));
  await page.waitForFunction(
    (least) => Number(document.querySelector<HTMLElement>(".scene canvas")?.dataset.frames) >= least,
    before + 2,
  );
}

const browser = await launch();

async function open(url: string, viewport: { width: number; height: number }): Promise<Page> {
  const page = await browser.newPage({ viewport, colorScheme: "dark" });
  await page.goto(url);
  await page.locator(".health", { hasText: /^all/ }).waitFor({ timeout: 60_000 });
  return page;
}

/** A still link, inflated to 0.5 kPa, whose skin is pressed by mouse. */
async function pressed(): Promise<void> {
  const server = new Server();
  const free = `taclink_scene: 1
name: free
model: cylinder
frame_rate_hz: 10
duration_s: 3600
pressure_keyframes: [{time_s: 4, kpa: 0}, {time_s: 6, kpa: 0.5}, {time_s: 3600, kpa: 0.5}]
`;
  const scene = server.write("free.yaml", free);
  await server.start(
    "--config",
    server.write("arm.yaml", configuration("lab", { lower: scene, upper: scene })),
  );
  const page = await open(`${server.url}?link=upper`, WIDE);
  await page.locator('tr[data-link="upper"]', { hasText: "0.50 kPa" }).waitFor({ timeout: 60_000 });
  await page.getByRole("button", { name: /^Focus/ }).click();
  await page.locator(".poke input[type=range]").fill("12");
  await drawn(page);
  const box = (await page.locator(".scene canvas").boundingBox())!;
  await page.mouse.move(box.x + 0.51 * box.width, box.y + 0.45 * box.height);
  await page.mouse.down();
  await page.locator(".felt").waitFor();
  await page.waitForTimeout(6000);
  await save(page, "poke");
  await page.mouse.up();
  await server.close();
}

/** The arm of the demo, wide and on a phone. */
async function demo(): Promise<void> {
  const server = new Server();
  await server.start("--config", join(REPOSITORY, "deploy/config/swinging-arm.yaml"));
  for (const [name, viewport] of [
    ["live", WIDE],
    ["phone", PHONE],
  ] as const) {
    const page = await open(server.url, viewport);
    await page.locator(".health", { hasText: /touches/ }).waitFor({ timeout: 60_000 });
    await page.waitForTimeout(2500);
    await save(page, name);
    await page.close();
  }
  await server.close();
}

async function twelve(): Promise<void> {
  const server = new Server();
  const scenes = Object.fromEntries(
    Array.from({ length: 12 }, (_, i) => [`link-${i + 1}`, i % 4 === 1 ? "press" : "rest"]),
  );
  await server.start("--config", server.write("arm.yaml", configuration("twelve", scenes)));
  const page = await open(server.url, WIDE);
  await page.locator(".health", { hasText: /touch/ }).waitFor({ timeout: 60_000 });
  await page.waitForTimeout(4000);
  await save(page, "twelve");
  await server.close();
}

const makers = { pressed, demo, twelve };
const chosen = process.argv.slice(2);
for (const [name, make] of Object.entries(makers))
  if (chosen.length === 0 || chosen.includes(name)) await make();
await browser.close();
