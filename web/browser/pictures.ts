// Makes docs/dashboard/{poke,live,phone,twelve}.png: npm run pictures
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { boxOf, launch, Visit } from "./page";
import { configuration, free, pressed, Server, untouched } from "./server";

const DRAWING_MS = 700; // what came is drawn by then
const REPOSITORY = fileURLToPath(new URL("../..", import.meta.url));
const WIDE = { width: 1600, height: 1000 };
const PHONE = { width: 390, height: 844 };

async function save({ page }: Visit, name: string): Promise<void> {
  await page.screenshot({ path: join(REPOSITORY, "docs/dashboard", `${name}.png`) });
}

const browser = await launch();

async function open(url: string, viewport: { width: number; height: number }): Promise<Visit> {
  const visit = await Visit.open(browser, url, { viewport });
  await visit.page.locator(".health", { hasText: /^all/ }).waitFor({ timeout: 60_000 });
  return visit;
}

/** As many touches are drawn beside the arm as the header says, `least` or more, and no link is late. */
function shows(least: number): boolean {
  const words = document.querySelector(".health")?.textContent ?? "";
  const count = /One touch/.test(words) ? 1 : Number(/(\d+) touches/.exec(words)?.[1] ?? 0);
  const labels = [...document.querySelectorAll<HTMLElement>(".label.force")].filter((each) => !each.hidden);
  return (
    /^all/.test(words) && count >= least && labels.length === count && !document.querySelector(".status.s5")
  );
}

/** Holds the server at such a moment: a picture takes longer than a touch may last. */
async function hold(visit: Visit, server: Server, least: number): Promise<void> {
  for (;;) {
    await visit.page.waitForFunction(shows, least, { timeout: 120_000, polling: "raf" });
    server.pause();
    await visit.page.waitForTimeout(DRAWING_MS);
    if (await visit.page.evaluate(shows, least)) return;
    server.resume();
  }
}

/** A still link, inflated to 0.5 kPa, whose skin is pressed by mouse. */
async function poked(): Promise<void> {
  const server = new Server();
  const scene = server.write("free.yaml", free());
  await server.start(
    "--config",
    server.write("arm.yaml", configuration("lab", { lower: scene, upper: scene })),
  );
  const visit = await open(`${server.url}?link=upper`, WIDE);
  const { page } = visit;
  await page.locator('tr[data-link="upper"]', { hasText: "0.50 kPa" }).waitFor({ timeout: 60_000 });
  await page.getByRole("button", { name: /^Focus/ }).click();
  await page.locator(".poke select").selectOption({ label: "hand" });
  await page.locator(".poke input[type=range]").first().fill("6");
  await visit.drawn();
  const box = await boxOf(page.locator(".scene canvas"));
  await page.mouse.move(box.x + 0.51 * box.width, box.y + 0.45 * box.height);
  await page.mouse.down();
  await visit.settledFelt();
  await visit.drawn();
  await save(visit, "poke");
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
    const visit = await open(server.url, viewport);
    await hold(visit, server, 3);
    await save(visit, name);
    server.resume();
    await visit.close();
  }
  await server.close();
}

async function twelve(): Promise<void> {
  const server = new Server();
  const still = server.write("still.yaml", untouched());
  const held = [0.2, 0.35, 0.5].map((forceN, i) =>
    server.write(`held${i}.yaml`, pressed(4 + 5 * i, 4 + i, forceN)),
  );
  const scenes = Object.fromEntries(
    Array.from({ length: 12 }, (_, i) => [`link-${i + 1}`, i % 4 === 1 ? held[(i - 1) / 4] : still]),
  );
  await server.start("--config", server.write("arm.yaml", configuration("twelve", scenes)));
  const visit = await open(server.url, WIDE);
  await hold(visit, server, 3);
  await save(visit, "twelve");
  await server.close();
}

const makers = { poked, demo, twelve };
const chosen = process.argv.slice(2);
for (const [name, make] of Object.entries(makers))
  if (chosen.length === 0 || chosen.includes(name)) await make();
await browser.close();
