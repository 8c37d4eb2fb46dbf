import { create } from "@bufbuild/protobuf";
import { expect, test } from "vitest";
import { ArmSchema } from "../src/api/gen/taclink/v1/arm_pb";
import { LinkFrameSchema } from "../src/api/gen/taclink/v1/frame_pb";
import { StreamPreviewResponseSchema } from "../src/api/gen/taclink/v1/preview_pb";
import { ArmStore } from "../src/model/arm_store";
import { PAST_S, Past, PastImages, type Measurement } from "../src/model/past";

function frame(timeS: number, forceN: number) {
  return create(LinkFrameSchema, {
    link: "upper",
    times: { exposureUtcNs: BigInt(Math.round(timeS * 1e6)) * 1000n },
    markersSeen: 1,
    positionsM: [0, 0, forceN],
    displacementCovariancesM2: [1, 2, 3, 4, 5, 6],
    totalForceN: { x: forceN },
    statusReason: `at ${timeS}`,
  });
}

const moment = (timeS: number) => ({ newest: frame(timeS, 0), shape: undefined });

test("the newest moment until then is found, and nothing before the first", () => {
  const past = new Past<Measurement>();
  for (let i = 0; i < 100; ++i) past.add(10 + i / 30, moment(10 + i / 30), 1);
  expect(past.at(9.9)).toBeUndefined();
  expect(past.at(10)?.newest?.statusReason).toBe("at 10");
  const found = Number(past.at(12)?.newest?.statusReason.slice(3));
  expect(found).toBeGreaterThan(11.8);
  expect(found).toBeLessThanOrEqual(12);
});

test("what is older than the page can look is forgotten, and time that goes back begins again", () => {
  const past = new Past<Measurement>();
  for (let i = 0; i < 2 * PAST_S; ++i) past.add(i, moment(i), 1);
  expect(past.oldestS).toBe(PAST_S - 1);
  past.add(5, moment(5), 1);
  expect(past.oldestS).toBe(5);
});

test("a frame that was exposed a little before the newest report loses nothing", () => {
  const store = new ArmStore(true);
  for (let i = 0; i <= 10; ++i) store.takeFrame(frame(100 + i, i));
  // A report without a frame is of now, frames are of some time before.
  store.takeFrame(create(LinkFrameSchema, { link: "upper", statusReason: "lost" }));
  store.takeFrame(frame(109.9, 3));
  store.takeFrame(frame(111.5, 4));
  expect(store.oldestS).toBe(100);
});

test("many links share the room: each keeps fewer moments over the same time", () => {
  const past = new Past<Measurement>();
  for (let i = 0; i < 30 * PAST_S; ++i) past.add(i / 30, moment(i / 30), 16);
  expect(past.oldestS).toBeLessThan(2);
  expect(past.count).toBeLessThan(300);
});

test("while one looks back frames come, but what is shown stays", () => {
  const store = new ArmStore(true);
  store.takeArm(create(ArmSchema, { links: [{ name: "upper" }] }));
  const drawn: string[] = [];
  store.onChange((link) => drawn.push(link));
  for (let i = 0; i <= 10; ++i) store.takeFrame(frame(100 + i, i));
  store.lookAt(104.5);
  const { shape } = store.link("upper");
  expect(shape?.totalForceN?.x).toBe(4);
  expect(shape?.displacementCovariancesM2).toEqual([]);
  store.takeFrame(frame(111, 11));
  expect(store.link("upper").newest?.totalForceN?.x).toBe(4);
  expect(store.link("upper").history.newestS).toBe(111);
  store.lookAt(undefined);
  expect(store.link("upper").newest?.totalForceN?.x).toBe(11);
  expect(drawn.length).toBeGreaterThan(12);
  // The oldest that is kept; and nothing lies after now.
  store.lookAt(99);
  expect(store.lookedAtS.value).toBe(100);
  expect(store.link("upper").newest?.totalForceN?.x).toBe(0);
  store.lookAt(112);
  expect(store.lookedAtS.value).toBeUndefined();
});

test("images are those of the link, and not of long before", () => {
  const images = new PastImages();
  const preview = create(StreamPreviewResponseSchema, { link: "upper" });
  images.add("upper", 10, preview);
  expect(images.at("upper", 9.9)).toBeUndefined();
  expect(images.at("upper", 11)).toBe(preview);
  expect(images.at("lower", 11)).toBeUndefined();
  expect(images.at("upper", 13)).toBeUndefined();
});

test("a link without frames changes nothing for the others, and shows nothing of now in the past", () => {
  const store = new ArmStore(true);
  store.takeArm(create(ArmSchema, { links: [{ name: "upper" }, { name: "silent" }] }));
  for (let i = 0; i <= 10; ++i) store.takeFrame(frame(100 + i, i));
  store.link("silent");
  expect(store.oldestS).toBe(100);
  store.lookAt(105);
  expect(store.link("upper").newest?.totalForceN?.x).toBe(5);
  expect(store.link("silent").newest?.status).toBe(0);
  expect(store.link("new").newest?.statusReason).toMatch(/Nothing is kept/);
});

test("what came long before is not shown for a moment without frames", () => {
  const store = new ArmStore(true);
  store.takeFrame(frame(100, 1));
  store.takeFrame(frame(120, 2));
  store.lookAt(102);
  expect(store.link("upper").newest?.totalForceN?.x).toBe(1);
  store.lookAt(110);
  expect(store.link("upper").newest?.totalForceN).toBeUndefined();
});
