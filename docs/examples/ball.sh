#!/bin/sh
# A ball on a string, swung by an arm: length and attachment of the string, and what the massless string lacks.
#
#   ball.sh [FOLDER]      writes FOLDER/run/report.html and FOLDER/why/report.html; FOLDER: default ./diffnea-ball
set -eu
folder=${1:-diffnea-ball}
mkdir -p "$folder"
cd "$folder"

# The description of a WAM with a cup and a ball that comes with diffnea.
model=$(diffnea worlds --json | sed -n 's/.*"file": "\(.*wam4_ball\.xml\)".*/\1/p')

# Slow motions in which upper arm and elbow turn the cup, and a world whose string is a rope of 2.25 g and 38 cm.
# With a real robot: your own train.csv and test.csv with ball_x, ball_y, ball_z of a camera.
for name in train test; do
  seed=$([ $name = train ] && echo 1 || echo 2)
  diffnea excite "$model" --duration 20 --period 20 --velocity-limit 0.8 --acceleration-limit 2 \
    --position-limit joint1=-0.8:0.8,joint2=0.2:1.0,joint3=-0.8:0.8,joint4=0.6:1.8 --seed "$seed" -o $name-motion.csv
  diffnea simulate "$model" --trajectory $name-motion.csv --world mujoco:wam4_ball,perturb=none,ball=chain,rope=heavy,string=0.38 --seed "$seed" -o $name.csv
done

diffnea identify "$model" train.csv --test test.csv -o run
# Of the description, so that length and attachment are fitted again beside each candidate: a diagnosis holds a string that
# was identified, and that of run/ has already become shorter to imitate the rope.
diffnea diagnose "$model" train.csv --test test.csv --effects linear_drag,quadratic_drag,wind,gravity_scale,string_mass,string_damping,camera_delay -o why
echo "open $PWD/run/report.html and $PWD/why/report.html"
