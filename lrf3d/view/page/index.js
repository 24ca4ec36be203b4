export { BeamsMesh } from "./beams.js";
export { Estimate } from "./estimate.js";
export { Inset } from "./inset.js";
export { MapBands, Trail } from "./marks.js";
export { Obstacles } from "./obstacles.js";
export { Replay } from "./replay.js";
export { Rig, VIEWS } from "./rig.js";
export { Stage, css } from "./stage.js";
