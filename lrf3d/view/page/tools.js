// What a page can do beside its scene: fill the screen, save a picture, and list its keys.

const DRIVING = [["W A S D, arrows", "drive"]];
const PLAYING = [
  ["Space", "play, pause"],
  ["← →", "two seconds back, ahead"],
  ["Home End", "to the start, to the end"],
];
const ALWAYS = [
  ["V", "next view"],
  ["F", "full screen"],
  ["P", "save a picture"],
  ["H", "this list"],
  ["Drag, wheel", "turn, zoom"],
];

// Keys and what they do, for a page that plays a run or one that is driven.
export function keyList(plays) {
  return [...(plays ? PLAYING : DRIVING), ...ALWAYS];
}

// Fill the screen with the page, or leave it.
export async function toggleFullScreen() {
  if (document.fullscreenElement) await document.exitFullscreen();
  else await document.documentElement.requestFullscreen();
}

// Save what a canvas shows; it must have been drawn in the same turn of the page's loop.
export function savePicture(canvas, name) {
  canvas.toBlob((picture) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(picture);
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  }, "image/png");
}
