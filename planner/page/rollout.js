/* What a vehicle does when its motor flips at given times: pose changes of the dwells, composed one after another.
 *
 * Mirrors planner/vehicle/rollout.py. Switches are {firstDirection ±1, dwells, poses}: dwell times, and poses
 * [x, y, heading] of the head's centre at the flips and the end. Lengths in l, times in μ0 l⁴/EI, angles in
 * rad. */
import { compose } from "./planar.js";
import { motionAfter } from "./vehicle.js";

const SAMPLES = 8; // of the track in each dwell

/* Poses of the head's centre at the flips, if `vehicle` carries out the schedule. poses_at_flips */
function posesAtFlips(vehicle, switches) {
  return chain(switches.poses[0], poseChanges(vehicle, switches, 1), switches.dwells, vehicle.current);
}

/* What a vehicle does on a schedule: changes of the pose in each dwell; poses of the head's centre at the flips
 * and the end; track [x, y] of the tracked point, at equal times within each dwell. roll_out */
function rollOut(vehicle, switches, offset, samples = SAMPLES) {
  const { dwells } = switches, [driftX, driftY] = vehicle.current;
  const changes = Array.from({ length: samples }, (_, k) => poseChanges(vehicle, switches, (k + 1) / samples));
  const flips = chain(switches.poses[0], changes[samples - 1], dwells, vehicle.current);
  const poses = [flips[0]];
  for (let i = 0; i < dwells.length; i++) {
    for (let k = 0; k < samples; k++) {
      const pose = compose(flips[i], changes[k][i]), time = dwells[i] * ((k + 1) / samples);
      poses.push([pose[0] + driftX * time, pose[1] + driftY * time, pose[2]]);
    }
  }
  const track = poses.map((pose) => compose(pose, [offset, 0, 0]).slice(0, 2));
  return { changes: changes[samples - 1], poses: flips, track };
}

/* The track [x, y] of the tracked point, at equal times within each dwell. */
function trace(vehicle, switches, offset, samples = SAMPLES) {
  return rollOut(vehicle, switches, offset, samples).track;
}

/* Poses of the head's centre, nine in each dwell. predicted_poses */
function predictedPoses(vehicle, switches) {
  const { dwells, poses } = switches, [driftX, driftY] = vehicle.current;
  const changes = Array.from({ length: 9 }, (_, k) => poseChanges(vehicle, switches, k / 8));
  return Array.from(dwells).flatMap((dwell, i) => changes.map((change, k) => {
    const pose = compose(poses[i], change[i]), time = (dwell * k) / 8;
    return [pose[0] + driftX * time, pose[1] + driftY * time, pose[2]];
  }));
}

/* The pose change in each dwell up to a share of it, from rest. pose_changes */
function poseChanges(vehicle, { firstDirection, dwells }, share) {
  return Array.from(dwells, (dwell, i) => {
    const before = i ? dwells[i - 1] : null;
    return motionAfter(vehicle, i % 2 ? -firstDirection : firstDirection, before, dwell * share);
  });
}

/* Compose poses from a start, pose changes, and a current during the dwells. */
function chain(start, changes, dwells, current) {
  const poses = [Array.from(start)];
  let turned = 0, x = 0, y = 0;
  changes.forEach((change, i) => {
    const c = Math.cos(start[2] + turned), s = Math.sin(start[2] + turned);
    x += c * change[0] - s * change[1] + current[0] * dwells[i];
    y += s * change[0] + c * change[1] + current[1] * dwells[i];
    turned += change[2];
    poses.push([start[0] + x, start[1] + y, start[2] + turned]);
  });
  return poses;
}

export { SAMPLES, posesAtFlips, rollOut, trace, predictedPoses, poseChanges };
