#!/bin/sh
# Identify a robot from recordings, on the command line.
#
#   identify.sh [FOLDER]      writes FOLDER/run/report.html; FOLDER: default ./diffnea-example
set -eu
folder=${1:-diffnea-example}
mkdir -p "$folder"
cd "$folder"

# The description of a WAM arm that comes with diffnea.
model=$(diffnea worlds --json | sed -n 's/.*"file": "\(.*wam4\.xml\)".*/\1/p')
diffnea info "$model"

# Two recordings of an arm that differs from it. With a real robot: your own train.csv and test.csv.
for name in train test; do
  seed=$([ $name = train ] && echo 1 || echo 2)
  diffnea excite "$model" --duration 10 --seed "$seed" -o $name-motion.csv
  diffnea simulate "$model" --trajectory $name-motion.csv --world mujoco:wam4,perturb=A,seed=5 -o $name.csv
done

diffnea identify "$model" train.csv --test test.csv -o run
echo "open $PWD/run/report.html"
