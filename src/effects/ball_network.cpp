#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/ball_network.hpp>

namespace diffnea {
namespace {

void require(bool ok, const std::string& where, const std::string& what) {
  if (!ok) throw ModelError(where + ": " + what);
}

void check_size(std::size_t got, long expected, const std::string& where) {
  require(static_cast<long>(got) == expected, where,
          "got " + std::to_string(got) + " numbers, expected " + std::to_string(expected));
}

void check_scale(const std::vector<double>& scale, const std::string& where) {
  for (const double x : scale) require(x > 0.0, where, "expected positive numbers");
}

/// @return its outputs
int check_layer(const DenseLayer& l, int inputs, const std::string& where) {
  require(l.inputs == inputs, where,
          "takes " + std::to_string(l.inputs) + " inputs, expected " + std::to_string(inputs) +
              ", what the one before it gives");
  require(l.outputs > 0, where, "has no outputs");
  check_size(l.weights.size(), static_cast<long>(l.inputs) * l.outputs, where + ".weights");
  check_size(l.bias.size(), l.outputs, where + ".bias");
  return l.outputs;
}

}  // namespace

int num_hidden(const BallNetwork& network) {
  int out = 0;
  for (const NetworkMember& m : network.members)
    for (const DenseLayer& cell : m.cells) out += cell.outputs / 2;
  return out;
}

void check(const BallNetwork& n, const std::string& where) {
  require(!n.members.empty(), where + ".members", "there are none");
  require(n.step > 0.0, where + ".step", "expected a positive time");
  constexpr double kLongest = 60.0;  // [s]: a start takes as many steps
  require(n.warm_up >= 0.0 && n.warm_up <= kLongest, where + ".warm_up",
          "got " + std::to_string(n.warm_up) + " s, expected 0 to " + std::to_string(kLongest));
  check_size(n.input_mean.size(), kNetworkInputs, where + ".input_mean");
  check_size(n.input_scale.size(), kNetworkInputs, where + ".input_scale");
  check_size(n.output_mean.size(), kNetworkOutputs, where + ".output_mean");
  check_size(n.output_scale.size(), kNetworkOutputs, where + ".output_scale");
  check_scale(n.input_scale, where + ".input_scale");
  check_scale(n.output_scale, where + ".output_scale");
  for (std::size_t k = 0; k < n.members.size(); ++k) {
    const NetworkMember& m = n.members[k];
    const std::string at = where + ".members[" + std::to_string(k) + "]";
    int width = kNetworkInputs;
    for (std::size_t i = 0; i < m.cells.size(); ++i) {
      const std::string cell = at + ".cells[" + std::to_string(i) + "]";
      const int units = m.cells[i].outputs / 4;
      require(m.cells[i].outputs == 4 * units, cell, "expected 4 gates a unit");
      check_layer(m.cells[i], width + units, cell);
      width = units;
    }
    for (std::size_t i = 0; i < m.layers.size(); ++i)
      width = check_layer(m.layers[i], width, at + ".layers[" + std::to_string(i) + "]");
    require(!m.layers.empty() && width == kNetworkOutputs, at,
            "gives " + std::to_string(width) + " numbers, expected 3, the acceleration");
  }
}

}  // namespace diffnea
