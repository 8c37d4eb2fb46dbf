import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { boxOf, launch, Visit } from "./page";
import { configuration, free, Server } from "./server";

const POKES = 20;

let browser: Browser;
const server = new Server();

beforeAll(async () => {
  const scene = server.write("free.yaml", free());
  await server.start("--config", server.write("arm.yaml", configuration("bench", { skin: scene })));
  browser = await launch();
});
afterAll(async () => {
  await browser?.close();
  await server.close();
});

// A linear congruential generator: the same places in every run.
function random(seed: number): () => number {
  let state = seed;
  return () => (state = (1103515245 * state + 12345) % 2 ** 31) / 2 ** 31;
}

test("what is pressed with the mouse is felt as it is", { timeout: 400_000 }, async () => {
  const visit = await Visit.open(browser, `${server.url}?link=skin`);
  const { page } = visit;
  await visit.row("skin").getByText("OK").waitFor();
  await expect.poll(() => visit.row("skin").innerText(), { timeout: 60_000 }).toContain("0.50 kPa");
  await page.getByRole("button", { name: /^Focus/ }).click();
  await visit.drawn();
  const box = await boxOf(page.locator(".scene canvas"));
  const number = random(45);
  const wrong: string[] = [];
  for (let poke = 0; poke < POKES; ++poke) {
    const [x, y] = [
      box.x + (0.46 + 0.08 * number()) * box.width,
      box.y + (0.3 + 0.4 * number()) * box.height,
    ];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await expect
      .poll(async () => (await visit.felt())?.trueN ?? 0, { timeout: 20_000 })
      .toBeGreaterThan(0.05);
    const { feltN, trueN, offMm } = await visit.settledFelt();
    if (poke === 0) await visit.picture("poke");
    if (Math.abs(feltN - trueN) > Math.max(0.1 * trueN, 0.03) || offMm > 4)
      wrong.push(
        `poke ${poke} at ${x.toFixed(0)}, ${y.toFixed(0)}: ${feltN} N, true ${trueN} N; ${offMm} mm off`,
      );
    await page.mouse.up();
    await expect.poll(() => page.locator(".felt").count(), { timeout: 20_000 }).toBe(0);
  }
  expect(wrong).toEqual([]);
  await visit.close();
});

test("a drag moves the body and the wheel presses it deeper", { timeout: 120_000 }, async () => {
  const visit = await Visit.open(browser, `${server.url}?link=skin`);
  const { page } = visit;
  await visit.row("skin").getByText("OK").waitFor();
  await page.getByRole("button", { name: /^Focus/ }).click();
  await visit.drawn();
  const box = await boxOf(page.locator(".scene canvas"));
  const center = async () => {
    const { stdout } = await import("./server").then(({ taclink }) =>
      taclink("watch", "--json", "--count", "1", "--server", server.address),
    );
    const contacts = JSON.parse(stdout.trim().split("\n").at(-1)!).contacts as { center_mm: number[] }[];
    return contacts[0]?.center_mm;
  };
  await page.mouse.move(box.x + box.width / 2, box.y + 0.4 * box.height);
  await page.mouse.down();
  await expect.poll(async () => (await visit.felt())?.trueN ?? 0, { timeout: 20_000 }).toBeGreaterThan(0.05);
  await expect.poll(center, { timeout: 20_000 }).toBeDefined();
  const before = await center();
  const force = (await visit.felt())!.trueN;
  await page.mouse.move(box.x + box.width / 2, box.y + 0.6 * box.height, { steps: 8 });
  await expect
    .poll(async () => Math.abs(((await center()) ?? before)[2] - before[2]), { timeout: 20_000 })
    .toBeGreaterThan(10);
  for (let notch = 0; notch < 3; ++notch) await page.mouse.wheel(0, -100);
  await expect
    .poll(async () => (await visit.felt())?.trueN ?? 0, { timeout: 20_000 })
    .toBeGreaterThan(1.2 * force);
  await page.mouse.up();
  await expect.poll(() => page.locator(".felt").count(), { timeout: 20_000 }).toBe(0);
  await visit.close();
});
