"""Motion capture files in: BVH and ASF/AMC, one or a folder, as clips in our conventions."""
