// The ways of beams by mirrors: a straight way, as long as its range, unfolded into its legs.

const MOST_LEGS = 9; // Legs of a beam: casters turn it up to eight times.

const LEAST_LEG = 1e-6; // Shortest leg, as a share of the rest of the way: it leaves its mirror.

// Follow a beam from a place to an end (both x, y) among mirrors (x1, y1, x2, y2, … in turn):
// gives the corners of its way, the end last, and the number of the first mirror, −1 for none.
export function follow(mirrors, [x, y], [toX, toY]) {
  const corners = [];
  let first = -1;
  while (corners.length + 1 < MOST_LEGS) {
    const { share, at } = crossing(mirrors, x, y, toX, toY);
    if (at < 0) break;
    if (!corners.length) first = at / 4;
    [x, y] = [x + share * (toX - x), y + share * (toY - y)];
    corners.push([x, y]);
    const [ux, uy] = [mirrors[at + 2] - mirrors[at], mirrors[at + 3] - mirrors[at + 1]];
    const twice = (2 * (ux * (toY - y) - uy * (toX - x))) / (ux * ux + uy * uy);
    [toX, toY] = [toX + twice * uy, toY - twice * ux];
  }
  corners.push([toX, toY]);
  return { corners, first };
}

// Which share of a way leads to the mirror that it meets first, and where that begins in the list.
function crossing(mirrors, x, y, toX, toY) {
  const [wx, wy] = [toX - x, toY - y];
  let [share, at] = [1, -1];
  for (let i = 0; i < mirrors.length; i += 4) {
    const [ox, oy] = [mirrors[i] - x, mirrors[i + 1] - y];
    const [ax, ay] = [mirrors[i + 2] - mirrors[i], mirrors[i + 3] - mirrors[i + 1]];
    const cross = wx * ay - wy * ax;
    const here = (ox * ay - oy * ax) / cross;
    const along = (ox * wy - oy * wx) / cross;
    if (here > LEAST_LEG && here < share && along >= 0 && along <= 1) [share, at] = [here, i];
  }
  return { share, at };
}
