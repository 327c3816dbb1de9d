// The texts that a page is made of, in the program since its build (page_texts.cmake).
#pragma once

namespace graybox::page_texts {

extern const char* const kTemplate;
extern const char* const kStyle;
extern const char* const kScript;
extern const char* const kCompare;
extern const char* const kPoses;
extern const char* const kDygraphs;
extern const char* const kDygraphsStyle;
extern const char* const kSynchronizer;
extern const char* const kLicences;

}  // namespace graybox::page_texts
