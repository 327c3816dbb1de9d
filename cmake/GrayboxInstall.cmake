# Installs the libraries, headers and the find_package(graybox) configuration.
get_property(graybox_libraries GLOBAL PROPERTY GRAYBOX_LIBRARIES)
install(TARGETS ${graybox_libraries} EXPORT graybox-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
foreach(folder problems solvers diagnosis)
  install(CODE "
    set(source \"${CMAKE_SOURCE_DIR}\")
    set(folder \"${folder}\")
    set(destination \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}/graybox\")
    include(\"${CMAKE_SOURCE_DIR}/cmake/install_headers.cmake\")")
endforeach()
install(DIRECTORY ${CMAKE_SOURCE_DIR}/problems/robot/
  DESTINATION ${CMAKE_INSTALL_DATADIR}/graybox/robot OPTIONAL)
install(EXPORT graybox-targets NAMESPACE graybox::
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/graybox-config.cmake.in
  ${CMAKE_BINARY_DIR}/graybox-config.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/graybox-config.cmake
  ${CMAKE_BINARY_DIR}/graybox-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/graybox)
