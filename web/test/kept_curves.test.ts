import { expect, test } from "vitest";
import { ArmStore } from "../src/model/arm_store";
import { keepCurves, restoreCurves } from "../src/model/kept_curves";

class Shelf implements Storage {
  readonly length = 0;
  text: string | null = null;
  constructor(private readonly room = Infinity) {}
  getItem = () => this.text;
  setItem(_: string, value: string): void {
    if (value.length > this.room) throw new Error("full");
    this.text = value;
  }
  removeItem(): void {
    this.text = null;
  }
  clear = () => undefined;
  key = () => null;
}

function storeOf(seconds: number): ArmStore {
  const store = new ArmStore();
  for (let i = 0; i < seconds * 30; ++i)
    store.link("a").history.add(1000 + i / 30, i % 7 === 0 ? NaN : i / 100, [{ id: "3", forceN: i / 100 }]);
  return store;
}

test("the last minute comes back as it was", () => {
  const shelf = new Shelf();
  const before = storeOf(90);
  keepCurves(before, shelf);
  const after = new ArmStore();
  restoreCurves(after, shelf);
  const [old, back] = [before, after].map((store) => store.link("a").history);
  expect(back.newestS).toBe(old.newestS);
  expect(back.length).toBe(1801);
  const [from, to] = [old.newestS - 60, old.newestS];
  const totals = back.totalsIn(from, to, 50, 1);
  old.totalsIn(from, to, 50, 1).forEach((value, i) => expect(totals[i]).toBeCloseTo(value!, 3));
  expect([...back.contactsIn(from, to, 5, 3).keys()]).toEqual(["3"]);
});

test("what goes on afterwards is added", () => {
  const shelf = new Shelf();
  keepCurves(storeOf(2), shelf);
  const store = new ArmStore();
  restoreCurves(store, shelf);
  store.link("a").history.add(1005, 4, []);
  expect(store.link("a").history.length).toBe(61);
});

test("without room, or with nonsense, there is nothing", () => {
  const full = new Shelf(100);
  keepCurves(storeOf(10), full);
  expect(full.text).toBeNull();
  const broken = new Shelf();
  broken.text = "{nonsense";
  const store = new ArmStore();
  restoreCurves(store, broken);
  expect([...store.links()]).toEqual([]);
});
