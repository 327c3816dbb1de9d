#include "diagnosis/estimation/quiet_ceres.hpp"

#include <glog/logging.h>

namespace graybox {

void silence_ceres() {
  if (!google::IsGoogleLoggingInitialized()) FLAGS_minloglevel = google::GLOG_FATAL;
}

}  // namespace graybox
