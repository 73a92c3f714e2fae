#pragma once
/// A function of numbers as a list of steps, recorded from a Python function (diffnea/_trace.py)
/// and evaluated for any scalar, without Python.

#include <array>
#include <string>
#include <vector>

#include <diffnea/core/error.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea::python {

enum class Operation {
  kInput,
  kConstant,
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kNegate,
  kSqrt,
  kExp,
  kLog,
  kSin,
  kCos,
  kArctan2
};

/// Names in the recording, in the enumeration's order.
inline constexpr std::array kOperations{"input",  "constant", "add",    "subtract", "multiply",
                                        "divide", "negate",   "sqrt",   "exp",      "log",
                                        "sin",    "cos",      "arctan2"};

/// @throws Error if no operation has this name
inline Operation operation_of(const std::string& name) {
  for (std::size_t k = 0; k < kOperations.size(); ++k)
    if (name == kOperations[k]) return static_cast<Operation>(k);
  throw Error("Constraint: got the operation '" + name + "', which diffnea does not know");
}

/// One operation on the results of earlier steps.
struct Step {
  Operation operation;
  int a, b;         ///< steps, or a's place among the inputs; −1: none
  double constant;  ///< value of kConstant
};

struct Expression {
  std::vector<Step> steps;
  std::vector<int> results;  ///< steps

  /// The results. @param input  callable: number k of the inputs, as T
  template <class T, class Input>
  std::vector<T> operator()(const Input& input) const {
    using std::atan2, std::cos, std::exp, std::log, std::sin, std::sqrt;
    std::vector<T> x;
    x.reserve(steps.size());
    const auto at = [&x](int k) -> const T& { return x[static_cast<std::size_t>(k)]; };
    for (const auto& [operation, a, b, constant] : steps) {
      switch (operation) {
        case Operation::kInput:
          x.push_back(input(a));
          break;
        case Operation::kConstant:
          x.push_back(T(constant));
          break;
        case Operation::kAdd:
          x.push_back(at(a) + at(b));
          break;
        case Operation::kSubtract:
          x.push_back(at(a) - at(b));
          break;
        case Operation::kMultiply:
          x.push_back(at(a) * at(b));
          break;
        case Operation::kDivide:
          x.push_back(at(a) / at(b));
          break;
        case Operation::kNegate:
          x.push_back(-at(a));
          break;
        case Operation::kSqrt:
          x.push_back(sqrt(at(a)));
          break;
        case Operation::kExp:
          x.push_back(exp(at(a)));
          break;
        case Operation::kLog:
          x.push_back(log(at(a)));
          break;
        case Operation::kSin:
          x.push_back(sin(at(a)));
          break;
        case Operation::kCos:
          x.push_back(cos(at(a)));
          break;
        case Operation::kArctan2:
          x.push_back(atan2(at(a), at(b)));
          break;
      }
    }
    std::vector<T> out;
    for (const int k : results) out.push_back(at(k));
    return out;
  }
};

}  // namespace diffnea::python
