/* Planar rigid motion: poses [x, y, ψ] and twists [forward, left, yaw rate].
 *
 * Mirrors sim/mechanics/planar.py. Lengths in any unit, angles in rad. */

const MIRROR = [1, -1, -1]; // reflection about the body's axis: what a reversed motor does

/* The pose reached by `then`, given in the frame of `first`. */
function compose(first, then) {
  const c = Math.cos(first[2]), s = Math.sin(first[2]);
  return [
    first[0] + (c * then[0] - s * then[1]), first[1] + (s * then[0] + c * then[1]), first[2] + then[2],
  ];
}

/* The pose that undoes a pose. inverse */
function inversePose(pose) {
  const c = Math.cos(-pose[2]), s = Math.sin(-pose[2]);
  return [-(c * pose[0] - s * pose[1]), -(s * pose[0] + c * pose[1]), -pose[2]];
}

/* The pose after holding a twist for a time. */
function arc(twist, time) {
  const angle = twist[2] * time, half = angle / 2;
  const along = time * sinc(angle), across = time * sinc(half) * Math.sin(half);
  return [along * twist[0] - across * twist[1], across * twist[0] + along * twist[1], angle];
}

function sinc(x) {
  return x === 0 ? 1 : Math.sin(x) / x;
}

/* The net speed of a zigzag with equal dwells, each a lag and then an arc of the twist. net_speed */
function netSpeed(twist, lag, dwell) {
  const change = compose(lag, arc(twist, dwell)), image = change.map((part, i) => part * MIRROR[i]);
  const pair = compose(change, image);
  return Math.sqrt(pair[0] ** 2 + pair[1] ** 2) / (2 * dwell);
}

export { MIRROR, compose, inversePose, arc, netSpeed };
