#include <diffnea/dynamics/kinematics.hpp>

namespace diffnea {

#define DIFFNEA_INSTANTIATE(P, S)                                                                \
  template void forward_kinematics<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>,           \
                                         LinkKinematics<Prod<P, S>>&);                           \
  template void forward_kinematics<P, S>(const Tree<P>&, VecIn<S>, LinkKinematics<Prod<P, S>>&); \
  template void forward_kinematics<P, S>(const Tree<P>&, const LinkStates<P, S>&,                \
                                         LinkKinematics<Prod<P, S>>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_INSTANTIATE)

}  // namespace diffnea
