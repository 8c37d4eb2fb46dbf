import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import type { PreviewPicture, StreamPreviewResponse } from "../api/gen/taclink/v1/preview_pb";
import { keepOpen } from "../api/keep_open";
import { useApp } from "../app_state";
import { clockTime, fixed, secondsOf } from "../ui/format";

const RATE_HZ = 5;
const FOUND = "#3ddc97";

/** What the two cameras of a link see, with the markers found there. */
export function CameraView({ link }: { link: Link }) {
  const app = useApp();
  const preview = useSignal<StreamPreviewResponse | undefined>(undefined);
  const trouble = useSignal("");
  const withMarkers = useSignal(true);
  const withLabels = useSignal(false);

  const live = app.feed.value.connection.value.state === "live";
  useEffect(() => {
    preview.value = undefined;
    trouble.value = "";
    if (app.log.value) {
      trouble.value = "A log is played: pictures are shown of the live arm only.";
      return;
    }
    if (!live) return;
    const life = new AbortController();
    const visible = () => !document.hidden;
    void keepOpen(life.signal, {
      run: async (stop, alive) => {
        if (!visible()) return;
        const request = { link: link.name, maxRateHz: RATE_HZ };
        for await (const message of app.session.tactile.streamPreview(request, { signal: stop })) {
          alive();
          trouble.value = "";
          preview.value = message;
          if (!visible()) return;
        }
      },
      onLost: (reason) => (trouble.value = visible() ? reason : ""),
      silenceMs: 0,
    });
    return () => life.abort();
  }, [link.name, app.log.value, app.session.generation.value, live]);

  const cameras = preview.value?.pictures ?? [];
  return (
    <div class="cameras">
      <div class="row">
        <label class="small">
          <input
            type="checkbox"
            checked={withMarkers.value}
            onChange={(event) => (withMarkers.value = event.currentTarget.checked)}
          />{" "}
          markers found
        </label>
        <label class="small">
          <input
            type="checkbox"
            checked={withLabels.value}
            onChange={(event) => (withLabels.value = event.currentTarget.checked)}
          />{" "}
          labels (path.ring)
        </label>
      </div>
      {trouble.value && <p class="empty">{trouble.value}</p>}
      {preview.value && (
        <p class="small numbers">taken {clockTime(secondsOf(preview.value.exposureUtcNs))}</p>
      )}
      {!trouble.value && cameras.length === 0 && <p class="empty">Waiting for pictures …</p>}
      <div class="pictures">
        {cameras.map((picture) => (
          <Picture
            key={picture.camera}
            picture={picture}
            link={link}
            markers={withMarkers.value}
            labels={withLabels.value}
          />
        ))}
      </div>
      <CameraFacts link={link} />
    </div>
  );
}

function Picture(props: { picture: PreviewPicture; link: Link; markers: boolean; labels: boolean }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { picture, link, markers, labels } = props;
  const paths = link.model!.markers!.paths;

  useEffect(() => {
    if (picture.jpeg.length === 0) return;
    let gone = false;
    const blob = new Blob([picture.jpeg as Uint8Array<ArrayBuffer>], { type: "image/jpeg" });
    createImageBitmap(blob).then(
      (bitmap) => {
        if (!gone) draw(canvas.current!, bitmap, picture, paths, markers, labels);
        bitmap.close();
      },
      () => undefined, // a damaged picture: the next one comes soon
    );
    return () => {
      gone = true;
    };
  }, [picture, markers, labels]);

  return (
    <figure>
      {picture.jpeg.length > 0 ? (
        <canvas
          ref={canvas}
          width={picture.widthPx}
          height={picture.heightPx}
          role="img"
          aria-label={`${picture.camera} camera of ${link.name}, ${picture.markers.length} markers found`}
        />
      ) : (
        <p class="empty">{picture.whyMissing || "No picture."}</p>
      )}
      <figcaption>
        {picture.camera}: {picture.markers.length} markers
      </figcaption>
    </figure>
  );
}

function draw(
  canvas: HTMLCanvasElement,
  bitmap: ImageBitmap,
  picture: PreviewPicture,
  paths: number,
  markers: boolean,
  labels: boolean,
): void {
  const context = canvas.getContext("2d")!;
  context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  context.strokeStyle = context.fillStyle = FOUND;
  context.font = "9px system-ui";
  picture.markers.forEach((marker, i) => {
    const x = picture.centersPx[2 * i] + 0.5;
    const y = picture.centersPx[2 * i + 1] + 0.5;
    if (markers) {
      context.beginPath();
      context.arc(x, y, 5, 0, 2 * Math.PI);
      context.stroke();
    }
    if (labels) context.fillText(`${marker % paths}.${Math.floor(marker / paths)}`, x + 5, y - 4);
  });
}

function CameraFacts({ link }: { link: Link }) {
  const frame = useApp().store.value.link(link.name).newest;
  if (link.cameras.length === 0) return <p class="small">{link.source?.description}</p>;
  return (
    <dl class="facts">
      {link.cameras.map((camera, i) => (
        <>
          <dt>{camera.name}</dt>
          <dd class="numbers">
            {camera.device || camera.configured}
            {camera.format && `, ${camera.format}`}, {fixed(camera.rateHz, 1)}/s,{" "}
            {String(camera.lost + camera.damaged + camera.undecodable + camera.unpaired)} bad of{" "}
            {String(camera.pictures)}
            {frame?.cameras[i] && `, ${(frame.cameras[i].shareRead * 100).toFixed(0)} % of the picture read`}
            {camera.trouble && <div class="bad">{camera.trouble}</div>}
          </dd>
        </>
      ))}
    </dl>
  );
}
