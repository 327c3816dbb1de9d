#pragma once

namespace graybox {

// HDF5 prints nothing from now on, also not where the program ends with a damaged file open. For
// programs whose only word on HDF5 is graybox's; called before any file is opened.
void silence_hdf5();

}  // namespace graybox
