#!/bin/sh
# Ball in a cup from nothing: two motions are designed and recorded, the robot and its ball identified, a policy learned
# in the identified model, and tried in the world that was recorded.
#
#   ball_in_cup.sh [FOLDER]      writes FOLDER/loop/transfer/report.html; FOLDER: default ./diffnea-cup
set -eu
folder=${1:-diffnea-cup}
mkdir -p "$folder"
cd "$folder"

# The world: a WAM that differs from its description, and a rope of 1.2 g. With a real robot: `excite`, record, `identify`,
# then `learn` in run/model.json and your own controller for the policy's motion (`policy_0.json`).
diffnea experiment ball-in-cup --string 0.40 --world mujoco:wam4_ball_in_cup,perturb=A,rope=mid,seed=3 --seeds 2 --repetitions 3 \
  --arm-seconds 20 --ball-seconds 20 --ball-repetitions 2 -o loop

# The same policies where the string has no mass.
diffnea transfer loop/policy --world mujoco:wam4_ball_in_cup,perturb=A,rope=none,seed=3 --repetitions 0 -o tendon
echo "open $PWD/loop/transfer/report.html and $PWD/loop/policy/report.html"
