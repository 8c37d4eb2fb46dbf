import { expect, test } from "vitest";
import { binTimes, ForceHistory } from "../src/model/force_history";

function filled(): ForceHistory {
  const history = new ForceHistory(1000);
  for (let i = 0; i <= 300; ++i) {
    const forceN = i === 155 ? 9 : 1;
    history.add(100 + i / 30, forceN, i < 150 ? [] : [{ id: i < 250 ? "7" : "12", forceN }]);
  }
  return history;
}

test("a short peak is in the curve, however coarse it is", () => {
  for (const bins of [10, 37, 400])
    expect(Math.max(...filled().totalsIn(100, 110, bins, 1).map(Number))).toBe(9);
});

test("a gap shorter than the hold is filled, a longer one is not", () => {
  const history = new ForceHistory();
  history.add(10, 2, []);
  history.add(11, 3, []);
  history.add(20, 4, []);
  const curve = history.totalsIn(10, 21, 11, 2);
  expect(curve.slice(0, 4)).toEqual([2, 3, 3, 3]);
  expect(curve.slice(4, 10)).toEqual([null, null, null, null, null, null]);
  expect(curve[10]).toBe(4);
});

test("what was not measured is no zero", () => {
  const history = new ForceHistory();
  history.add(1, NaN, []);
  expect(history.totalsIn(0, 2, 2, 5)).toEqual([null, null]);
});

test("nothing is held beyond the newest sample", () => {
  const history = new ForceHistory();
  history.add(1, 5, []);
  expect(history.totalsIn(0, 4, 4, 10)).toEqual([null, 5, null, null]);
});

test("old samples fall out", () => {
  const history = new ForceHistory(10);
  for (let i = 0; i < 25; ++i) history.add(i, i, []);
  expect(history.length).toBe(10);
  expect(history.totalsIn(0, 14, 14, 0)).toEqual(new Array(14).fill(null));
  expect(history.totalsIn(15, 25, 10, 0)).toEqual([15, 16, 17, 18, 19, 20, 21, 22, 23, 24]);
});

test("a clock that goes back begins anew", () => {
  const history = new ForceHistory();
  history.add(50, 1, []);
  history.add(20, 2, []);
  expect(history.length).toBe(1);
  expect(history.newestS).toBe(20);
});

test("contacts come by id, in the order of their ids, the strongest only", () => {
  const both = filled().contactsIn(100, 110, 20, 8);
  expect([...both.keys()]).toEqual(["7", "12"]);
  expect(Math.max(...both.get("7")!.map(Number))).toBe(9);
  expect(both.get("12")![0]).toBeNull();
  expect([...filled().contactsIn(100, 110, 20, 1).keys()]).toEqual(["7"]);
});

test("bins are told by their middles", () => {
  expect(binTimes(0, 4, 4)).toEqual([0.5, 1.5, 2.5, 3.5]);
});

test("what the server remembers fills the gaps and replaces nothing", () => {
  const history = new ForceHistory();
  history.add(10, 1, [{ id: "7", forceN: 1 }]);
  history.add(12, 3, []);
  history.merge([
    [9, 0.5, []],
    [10, 8, []],
    [11, 2, [["7", 2]]],
    [11.5, null, []],
  ]);
  expect(history.samplesFrom(0)).toEqual([
    [9, 0.5, []],
    [10, 1, [["7", 1]]],
    [11, 2, [["7", 2]]],
    [11.5, null, []],
    [12, 3, []],
  ]);
  history.add(13, 4, []);
  expect(history.newestS).toBe(13);
});
