// What every reader of files promises: bad input is an InputError of one line.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "problems/base/error.hpp"

namespace graybox::testing {

// load() throws an InputError of one line that contains the text.
template <typename Load>
void expect_refused(const Load& load, const std::string& text) {
  try {
    load();
    ADD_FAILURE() << "not refused: " << text;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
  }
}

}  // namespace graybox::testing
