# Installs the libraries, headers and the find_package(graybox) configuration: one export for each
# component, so that who asks for solvers needs no packages of the diagnosis. Shared libraries go with
# the program, which needs them.
foreach(component IN LISTS graybox_components)
  get_property(libraries GLOBAL PROPERTY GRAYBOX_LIBRARIES_${component})
  set(optional "")
  if(component STREQUAL "distributed")  # not there where a script built the program alone
    set(optional OPTIONAL)
  endif()
  install(TARGETS ${libraries} EXPORT graybox-${component}-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} ${optional}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT program ${optional}
      NAMELINK_COMPONENT Unspecified)
  install(EXPORT graybox-${component}-targets NAMESPACE graybox::
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
endforeach()
install(CODE "
  set(source \"${CMAKE_SOURCE_DIR}\")
  set(components \"${graybox_components}\")
  set(destination \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}/graybox\")
  include(\"${CMAKE_SOURCE_DIR}/cmake/install_headers.cmake\")")
install(DIRECTORY ${CMAKE_SOURCE_DIR}/problems/robot/
  DESTINATION ${CMAKE_INSTALL_DATADIR}/graybox/robot COMPONENT program OPTIONAL)
configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/graybox-config.cmake.in
  ${CMAKE_BINARY_DIR}/graybox-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/graybox-config.cmake
  ${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
