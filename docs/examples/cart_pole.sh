#!/bin/sh
# A cart with a pole that nothing drives: what both are, and what the model lacks, from the force on the cart alone.
#
#   cart_pole.sh [FOLDER]      writes FOLDER/run/report.html and FOLDER/why/report.html; FOLDER: default ./diffnea-cart
set -eu
folder=${1:-diffnea-cart}
mkdir -p "$folder"
cd "$folder"
model=$(diffnea worlds --json | sed -n 's/.*"file": "\(.*cart_pole\.xml\)".*/\1/p')

# The rig: masses, friction and inertias are not the description's, the pole's bearing is greased, and the magnets of the
# cart's linear motor, 60 mm apart, pull at it. With a real one: your own train.csv and test.csv.
rig=mujoco:cart_pole,perturb=A,seed=3,effect=viscous_friction@pole:viscous=0.004,effect=cogging@cart:sine=0.4+cycles=104.72

# Limits of your own: the model states neither speed nor acceleration, and a pole that hardly swings tells little.
for name in train test; do
  seed=$([ $name = train ] && echo 1 || echo 2)
  diffnea excite "$model" --harmonics 12 --velocity-limit 1.5 --acceleration-limit 8 --seed "$seed" -o $name-motion.csv
  diffnea simulate "$model" --trajectory $name-motion.csv --world $rig --seed "$seed" -o $name.csv
done

diffnea identify "$model" train.csv --test test.csv -o run
diffnea diagnose run/model.json train.csv --test test.csv -o why
echo "open $PWD/run/report.html and $PWD/why/report.html"
