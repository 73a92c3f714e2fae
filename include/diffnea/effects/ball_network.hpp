#pragma once
/// The ball's motion as a network has it, ẍ_B = f(x_L, ẋ_L, ẍ_L, x_B, ẋ_B): the black box that the
/// models of this library are measured against. L is the last link that moves, on which the string
/// hangs; x_L is its full pose, with twist and acceleration.
///
/// Physics is the same wherever the arm stands and whichever way it faces, so that f is asked and
/// answers in L (a network need not learn that; the direction of e_z is all it sees of the world):
///
///   R_WLᵀ ẍ_B = f(R_WLᵀ [x_B − p_L, ẋ_B − ṗ_L, ω_L, ω̇_L, p̈_L, e_z])
///
/// The ball moves in steps of h, as the network was trained to: ẋ_B += h ẍ_B, x_B += h ẋ_B, with
/// pose and twist of L at the step's beginning, and ω̇_L, p̈_L as they change over it.

#include <string>
#include <vector>

#include <diffnea/lie/se3.hpp>

namespace diffnea {

/// y = W x + b
struct DenseLayer {
  int inputs = 0;               ///< length of x
  int outputs = 0;              ///< length of y; of a cell: 4n, its gates
  std::vector<double> weights;  ///< Wᵀ, (inputs × outputs) by rows
  std::vector<double> bias;     ///< (outputs)
};

/// Standardised inputs through recurrent cells, then through layers with tanh between them.
struct NetworkMember {
  /// LSTM cells of n units: of [input, hidden] to the gates i, f, g, o, (4n). No peepholes.
  std::vector<DenseLayer> cells;
  std::vector<DenseLayer> layers;  ///< at least one; the last has three outputs
};

inline constexpr int kNetworkInputs = 18;  ///< six vectors of 3, as f has them
inline constexpr int kNetworkOutputs = 3;  ///< R_WLᵀ ẍ_B

/// An ensemble: the mean of its members' answers.
struct BallNetwork {
  std::vector<NetworkMember> members;  ///< at least one
  /// (18) of the input: members are asked (x − mean) / scale.
  ///@{
  std::vector<double> input_mean, input_scale;
  ///@}
  /// (3) of the answer [m/s²]: mean + scale · what members answer in the mean.
  ///@{
  std::vector<double> output_mean, output_scale;
  ///@}
  double step = 0.002;   ///< h [s]
  double warm_up = 0.0;  ///< for which cells see the motion before the ball is theirs [s]
  std::string source;    ///< file that it was read from
  std::string text;      ///< of it
  std::string sha256;    ///< of that
};

/// A link's motion, as a network sees it: expressed in W.
template <class T>
struct LinkMotion {
  Pose<T> X_WL;              ///< pose of L
  Vec3<T> velocity;          ///< of L's origin [m/s]
  Vec3<T> angular_velocity;  ///< of L [rad/s]
};

/// Numbers that an ensemble's cells remember.
int num_hidden(const BallNetwork& network);

/// @throws ModelError naming `where` and the layer if sizes do not fit one another
void check(const BallNetwork& network, const std::string& where);

/// Evaluates a network; holds scratch, no allocation after construction.
template <class T>
class NetworkEvaluator {
 public:
  /// @param network  outlives this
  explicit NetworkEvaluator(const BallNetwork& network);

  /// @param input  (18) as above
  /// @param hidden  (num_hidden) what cells remember, read and written; 0 at first
  /// @return R_WLᵀ ẍ_B [m/s²]
  Vec3<T> operator()(const T* input, T* hidden);

 private:
  T* member(const NetworkMember& m, T*& hidden);

  const BallNetwork& network_;
  std::vector<T> input_, a_, b_;
};

/// What the network is asked at the beginning of a step.
/// @param link, end  its motion at the beginning and the end of the step of h [s]
/// @param x, v  the ball, W [m, m/s]  @param out  (18)
template <class T>
void network_input(const LinkMotion<T>& link, const LinkMotion<T>& end, double h, const Vec3<T>& x,
                   const Vec3<T>& v, T* out);

}  // namespace diffnea

#include <diffnea/effects/detail/ball_network_impl.hpp>
