#!/bin/sh
# A rotary pendulum: the motor turns an arm about the vertical, the pendulum at its end swings freely.
#
#   furuta.sh [FOLDER]      writes FOLDER/run/report.html and FOLDER/why/report.html; FOLDER: default ./diffnea-furuta
set -eu
folder=${1:-diffnea-furuta}
mkdir -p "$folder"
cd "$folder"
model=$(diffnea worlds --json | sed -n 's/.*"file": "\(.*furuta\.xml\)".*/\1/p')

# The rig: masses, friction and inertias are not the description's, and the cable to the pendulum's encoder, which goes
# through the arm's axis, winds up like a spring. With a real one: your own train.csv and test.csv.
rig=mujoco:furuta,perturb=A,seed=3,effect=joint_spring@arm:stiffness=0.01+rest=0.2

for name in train test; do
  seed=$([ $name = train ] && echo 1 || echo 2)
  diffnea excite "$model" --period 5 --harmonics 8 --velocity-limit 6 --acceleration-limit 80 --seed "$seed" -o $name-motion.csv
  diffnea simulate "$model" --trajectory $name-motion.csv --world $rig --seed "$seed" -o $name.csv
done

diffnea identify "$model" train.csv --test test.csv -o run
# Of the description, to have the spring's rest as well: `identify` fits an offset of the torque, beside which the rest cannot
# be told. Of run/model.json the spring alone is named, without its rest; the drive's friction is in that model.
diffnea diagnose "$model" train.csv --test test.csv -o why
echo "open $PWD/run/report.html and $PWD/why/report.html"
