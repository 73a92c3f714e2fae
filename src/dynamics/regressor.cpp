#include <diffnea/dynamics/regressor.hpp>

namespace diffnea {

#define DIFFNEA_INSTANTIATE(P, S)                                                                \
  template const RowMatX<Prod<P, S>>& torque_regressor<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, \
                                                             VecIn<S>, RegressorWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_INSTANTIATE)

}  // namespace diffnea
