import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import type { PreviewPicture, StreamPreviewResponse } from "../api/gen/taclink/v1/preview_pb";
import { keepOpen, sleep } from "../api/keep_open";
import { messageOf, type Session } from "../api/session";
import { useApp } from "../app_state";
import { ReplayFeed } from "../model/replay_feed";
import { clockTime, fixed, secondsOf } from "../ui/format";

const RATE_HZ = 5;
const FOUND = "#3ddc97";

/** Two pictures of one moment, live or from a log. */
type Pictures = Pick<StreamPreviewResponse, "exposureUtcNs" | "pictures">;

/** What the two cameras of a link see, with the markers found there. */
export function CameraView({ link }: { link: Link }) {
  const app = useApp();
  const preview = useSignal<Pictures | undefined>(undefined);
  const trouble = useSignal("");
  const withMarkers = useSignal(true);
  const withLabels = useSignal(false);

  const feed = app.feed.value;
  const recorded = feed instanceof ReplayFeed;
  const live = feed.connection.value.state === "live";
  useEffect(() => {
    preview.value = undefined;
    trouble.value = "";
    if (!live) return;
    const life = new AbortController();
    const show = (pictures: Pictures) => {
      trouble.value = "";
      preview.value = pictures;
    };
    const keep = (pictures: StreamPreviewResponse) => {
      app.pastImages.add(link.name, secondsOf(pictures.exposureUtcNs), pictures);
      show(pictures);
    };
    const lost = (reason: string) => (trouble.value = document.hidden ? "" : reason);
    if (feed instanceof ReplayFeed) void followLog(feed, link.name, life.signal, show, lost);
    else void followLive(app.session, link.name, life.signal, keep, lost);
    return () => life.abort();
  }, [link.name, feed, app.session.generation.value, live]);

  const lookedAtS = app.store.value.lookedAtS.value;
  const shown = lookedAtS === undefined ? preview.value : app.pastImages.at(link.name, lookedAtS);
  const cameras = shown?.pictures ?? [];
  const missing =
    lookedAtS === undefined
      ? trouble.value || "Waiting for images …"
      : "No images of this moment: they are kept only while Cameras is open.";
  return (
    <div class="cameras">
      {recorded ? (
        <p class="small">Logs hold the markers' positions, not where they were found in the pictures.</p>
      ) : (
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
      )}
      {cameras.length === 0 && <p class="empty">{missing}</p>}
      {shown && <p class="small numbers">taken {clockTime(secondsOf(shown.exposureUtcNs))}</p>}
      <div class="pictures">
        {cameras.map((picture) => (
          <Picture
            key={picture.camera}
            picture={picture}
            link={link}
            recorded={recorded}
            markers={withMarkers.value}
            labels={withLabels.value}
          />
        ))}
      </div>
      <CameraFacts link={link} />
    </div>
  );
}

type Show = (pictures: Pictures) => void;
type Lost = (reason: string) => void;

async function followLive(
  session: Session,
  link: string,
  stop: AbortSignal,
  show: (pictures: StreamPreviewResponse) => void,
  lost: Lost,
): Promise<void> {
  await keepOpen(stop, {
    run: async (end, alive) => {
      if (document.hidden) return;
      const request = { link, maxRateHz: RATE_HZ };
      for await (const message of session.tactile.streamPreview(request, { signal: end })) {
        alive();
        show(message);
        if (document.hidden) return;
      }
    },
    onLost: lost,
    silenceMs: 0,
  });
}

async function followLog(
  feed: ReplayFeed,
  link: string,
  stop: AbortSignal,
  show: Show,
  lost: Lost,
): Promise<void> {
  let shown = NaN;
  for (; !stop.aborted; await sleep(1000 / RATE_HZ, stop)) {
    const timeS = feed.positionS.peek();
    if (timeS === shown || document.hidden) continue;
    try {
      const pictures = await feed.picturesOf(link, timeS, stop);
      if (!pictures) continue;
      show(pictures);
      shown = timeS;
    } catch (error) {
      if (!stop.aborted) lost(messageOf(error));
    }
  }
}

interface PictureProps {
  picture: PreviewPicture;
  link: Link;
  /** From a log, which has no markers. */
  recorded: boolean;
  markers: boolean;
  labels: boolean;
}

function Picture(props: PictureProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { picture, link, recorded, markers, labels } = props;
  const paths = link.model!.markers!.paths;
  const found = recorded ? "" : `${picture.markers.length} markers`;

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
          width={picture.widthPx || 640}
          height={picture.heightPx || 480}
          role="img"
          aria-label={`${picture.camera} camera of ${link.name}${found && `, ${found} found`}`}
        />
      ) : (
        <p class="empty">{picture.whyMissing || "No picture."}</p>
      )}
      <figcaption>
        {picture.camera}
        {found && `: ${found}`}
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
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  context.drawImage(bitmap, 0, 0);
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
