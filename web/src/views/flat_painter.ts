import type { MarkerRange } from "../api/gen/taclink/v1/events_pb";
import { paintFlat } from "../skin/unroll";
import { sizeOf } from "../ui/element_size";

const FINE = 6; // pixels of the picture a cell, before the browser scales it
const HATCH_GROUND = "#4a525c";
const HATCH_LINES = "#6d7782";

/** A marker's cell, both from 0. */
export interface Cell {
  path: number;
  ring: number;
}

/** Draws a skin laid flat on a canvas. */
export class FlatPainter {
  /** Of lines. */
  ink = "#ffffff";
  private readonly picture: ImageData;
  private readonly buffer = document.createElement("canvas");
  private readonly bufferContext = this.buffer.getContext("2d")!;
  private readonly context: CanvasRenderingContext2D;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly paths: number,
    private readonly rings: number,
    fine = FINE,
  ) {
    this.buffer.width = paths * fine;
    this.buffer.height = rings * fine;
    this.picture = new ImageData(this.buffer.width, this.buffer.height);
    this.context = canvas.getContext("2d")!;
  }

  /** Stripes: nothing is known here. */
  hatch(): void {
    this.fit();
    const { context, canvas } = this;
    context.fillStyle = HATCH_GROUND;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.strokeStyle = HATCH_LINES;
    context.lineWidth = 4 * devicePixelRatio;
    context.beginPath();
    const step = 14 * devicePixelRatio;
    for (let x = -canvas.height; x < canvas.width; x += step) {
      context.moveTo(x, canvas.height);
      context.lineTo(x + canvas.height, 0);
    }
    context.stroke();
  }

  private fit(): void {
    const box = sizeOf(this.canvas);
    const width = Math.round(box.width * devicePixelRatio);
    const height = Math.round(box.height * devicePixelRatio);
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }

  paint(values: ArrayLike<number>, range: number, table: Uint8Array): void {
    this.fit();
    const { width, height } = this.buffer;
    paintFlat(
      this.picture.data,
      width,
      height,
      values,
      { paths: this.paths, rings: this.rings },
      table,
      range,
    );
    this.bufferContext.putImageData(this.picture, 0, 0);
    this.context.imageSmoothingEnabled = true;
    this.context.drawImage(this.buffer, 0, 0, this.canvas.width, this.canvas.height);
  }

  private x(path: number): number {
    return (path / this.paths) * this.canvas.width;
  }
  private y(ring: number): number {
    return (1 - ring / this.rings) * this.canvas.height;
  }

  // A second and a third time a turn away: what crosses the seam is on both sides of it.
  outline(corners: readonly [path: number, ring: number][]): void {
    const { context } = this;
    context.beginPath();
    for (const turn of [-this.paths, 0, this.paths]) {
      for (const [i, [path, ring]] of corners.entries()) {
        if (i === 0) context.moveTo(this.x(path + turn), this.y(ring));
        else context.lineTo(this.x(path + turn), this.y(ring));
      }
      context.closePath();
    }
    context.strokeStyle = this.ink;
    context.lineWidth = 2 * devicePixelRatio;
    context.stroke();
  }

  regions(regions: readonly MarkerRange[]): void {
    const { context } = this;
    context.strokeStyle = this.ink;
    context.lineWidth = devicePixelRatio;
    context.setLineDash([6, 4]);
    for (const { firstRing, lastRing, firstPath, lastPath } of regions) {
      const parts =
        firstPath <= lastPath
          ? [[firstPath, lastPath]]
          : [
              [firstPath, this.paths - 1],
              [0, lastPath],
            ];
      for (const [from, to] of parts) {
        const top = this.y(lastRing + 1);
        context.strokeRect(this.x(from), top, this.x(to + 1) - this.x(from), this.y(firstRing) - top);
      }
    }
    context.setLineDash([]);
  }

  mark(cell: Cell | undefined): void {
    if (!cell) return;
    const { context } = this;
    context.strokeStyle = "#ff6a13";
    context.lineWidth = 2 * devicePixelRatio;
    const top = this.y(cell.ring + 1);
    context.strokeRect(this.x(cell.path), top, this.x(1), this.y(cell.ring) - top);
  }
}
